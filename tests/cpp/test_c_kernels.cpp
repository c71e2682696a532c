#include <doctest/doctest.h>

#include <stdexcept>
#include <string>

#include "fisherpoint/compiled/c_kernels.hpp"

using namespace fisherpoint;

TEST_CASE("what a kernel throws crosses the C interface as an outcome, with its reason") {
  char reason[fisherpoint_reason_size] = "";
  FisherpointRequest request{};
  request.reason = reason;
  CHECK(outcome_of(request, [] {}) == fisherpoint_done);
  CHECK(outcome_of(request, [] { throw Interrupted{}; }) == fisherpoint_stopped);
  CHECK(outcome_of(request, [] { throw std::bad_alloc(); }) == fisherpoint_out_of_memory);
  CHECK(std::string(reason) == "");
  CHECK(outcome_of(request, [] { throw 1; }) == fisherpoint_failed);
  CHECK(std::string(reason) == "an exception of unknown type");
  CHECK(outcome_of(request, [] { throw std::runtime_error("no"); }) == fisherpoint_failed);
  CHECK(std::string(reason) == "no");
  const std::string long_one(1000, 'x');
  CHECK(outcome_of(request, [&] { throw std::runtime_error(long_one); }) == fisherpoint_failed);
  CHECK(std::string(reason) == long_one.substr(0, fisherpoint_reason_size - 1));
}
