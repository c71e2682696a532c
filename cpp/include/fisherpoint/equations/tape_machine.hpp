// Carries out the lists of operations of a tape (tape.hpp).
#pragma once

#include "fisherpoint/models/tape.hpp"
#include "fisherpoint/numbers/functions.hpp"

namespace fisherpoint {

// A program with the registers that it works on. Leaves are read where the caller keeps them. Functions that were compiled for
// the program (straight_functions.hpp) compute the same, to the last bit.
template <class P>
class Machine {
 public:
  using Array = HeapArray<P>;

  // `theta` and `u` must outlive the machine.
  Machine(const Program& program, const Shape<TapeModel>& shape, const Array& theta, const Array& u)
      : program_(program),
        straight_(fits(program.straight) ? program.straight : nullptr),
        own_(straight_ ? straight_->packs : program.registers - theta.size() - u.size()),
        at_(straight_ ? 0 : program.registers) {
    if (straight_) {
      leaves_ = {numbers_of(theta), numbers_of(u), nullptr, nullptr, nullptr};
      straight_->setup(&leaves_, numbers_of(own_));
      return;
    }
    const P** next = at_.begin();
    P* own = own_.begin();
    for (const double literal : program.literals) *own = P(literal), *next++ = own++;
    next = refer(next, theta);
    x_ = next = refer(next, u);
    side_ = x_ + shape.states;
    dx_ = side_ + shape.kinks_end;
    for (next = dx_ + shape.states; next != at_.end();) *next++ = own++;
    carry_out(program.setup, at_.data());
  }

  void run(const Array& x) {
    if (straight_) {
      leaves_.x = numbers_of(x);
      straight_->stage(&leaves_, numbers_of(own_));
      return;
    }
    refer(x_, x);
    carry_out(program_.stage, at_.data());
  }
  void run(const Array& x, const Array& side) {
    leaves_.side = numbers_of(side);
    if (!straight_)
      for (const P** place = side_; place != dx_; ++place) *place = &side[place - side_];
    run(x);
  }
  void run_along(const Array& x, const Array& dx) {
    leaves_.dx = numbers_of(dx);
    if (!straight_) refer(dx_, dx);
    run(x);
  }
  void run_along(const Array& x, const Array& dx, const Array& side) {
    leaves_.dx = numbers_of(dx);
    if (!straight_) refer(dx_, dx);
    run(x, side);
  }

  const P& output(int i) const { return straight_ ? own_[i] : *at_[program_.outputs[i]]; }

 private:
  [[gnu::noinline]] static void carry_out(const std::vector<Instruction>& instructions, const P* const* at) {
    using O = Operation;
    for (const auto& [operation, out, first, second, third] : instructions) {
      const P &a = *at[first], &b = *at[second], &c = *at[third];
      P& result = const_cast<P&>(*at[out]);  // of what is computed, which is our own
      switch (operation) {
        case O::add:
          result = a + b;
          break;
        case O::sub:
          result = a - b;
          break;
        case O::mul:
          result = a * b;
          break;
        case O::div:
          result = a / b;
          break;
        case O::neg:
          result = -a;
          break;
        case O::mul_add:
          result = fused(a, b, c);
          break;
        case O::mul_sub:
          result = fused(a, b, -c);
          break;
        case O::sub_mul:
          result = fused(-a, b, c);
          break;
        case O::sqrt:
          result = sqrt(a);
          break;
        case O::exp:
          result = exp(a);
          break;
        case O::log:
          result = log(a);
          break;
        case O::sin:
          result = sin(a);
          break;
        case O::cos:
          result = cos(a);
          break;
        case O::tan:
          result = tan(a);
          break;
        case O::asin:
          result = asin(a);
          break;
        case O::acos:
          result = acos(a);
          break;
        case O::atan:
          result = atan(a);
          break;
        case O::sinh:
          result = sinh(a);
          break;
        case O::cosh:
          result = cosh(a);
          break;
        case O::tanh:
          result = tanh(a);
          break;
        case O::pow:
          result = power(a, b);
          break;
        case O::abs:
          result = abs(a);
          break;
        case O::sign:
          result = sign(a);
          break;
        case O::min:
          result = min(a, b);
          break;
        case O::max:
          result = max(a, b);
          break;
        case O::select:
          result = select(a > P(0.0), b, c);
          break;
        case O::count:
          break;
      }
    }
  }

  // Whether functions are for such packs, and for the level at which this is compiled.
  static bool fits(const FisherpointProgram* straight) {
    return straight && straight->lanes == lanes_of<P>::width && straight->register_bytes == register_bytes;
  }
  static const double* numbers_of(const Array& packs) { return reinterpret_cast<const double*>(packs.data()); }
  static double* numbers_of(Array& packs) { return reinterpret_cast<double*>(packs.data()); }

  static const P** refer(const P** place, const Array& leaves) {
    for (const P& leaf : leaves) *place++ = &leaf;
    return place;
  }

  const Program& program_;
  const FisherpointProgram* straight_;  // its functions, which do the work if there are any
  FisherpointLeaves leaves_{};
  Array own_;                    // literals and what is computed
  HeapArray<const P*> at_;       // where every register is
  const P **x_, **side_, **dx_;  // where these leaves are told
};

}  // namespace fisherpoint
