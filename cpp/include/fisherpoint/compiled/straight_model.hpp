// A tape whose programs have functions that were compiled for them while the program runs; the kernels stay those of tapes. On
// packs of another width or level than the functions are for, its lists are carried out.
#pragma once

#include <string>

#include "fisherpoint/compiled/library.hpp"
#include "fisherpoint/models/straight_functions.hpp"
#include "fisherpoint/models/tape.hpp"

namespace fisherpoint {

class StraightModel : public TapeModel {
 public:
  // Throws std::runtime_error where the shared object is none for a model. It stays loaded.
  StraightModel(const TapeModel& tape, const std::string& path) : TapeModel(tape) {
    attach(*table_of<FisherpointStraight>(path, "fisherpoint_programs", fisherpoint_straight_version));
  }
};

}  // namespace fisherpoint
