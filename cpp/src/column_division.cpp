// Compiled with the kernels' optimisation; the bindings have little of that.
#include "fisherpoint/kernels/column_division.hpp"

namespace fisherpoint {

void divide_columns(const CandidateColumns& columns, const double* factor, double* out) {
  ColumnDivision(columns, factor).divide(out);
}
void determinant_gains(const CandidateColumns& columns, const double* factor, double* out) {
  ColumnDivision(columns, factor).gains(out);
}

}  // namespace fisherpoint
