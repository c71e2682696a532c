// Carries out the lists of operations of a tape (tape.hpp).
#pragma once

#include <utility>

#include "fisherpoint/models/tape.hpp"
#include "fisherpoint/numbers/functions.hpp"
#include "fisherpoint/numbers/parts.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

// A program with the registers that it works on. Leaves are read where the caller keeps them. Functions that were compiled for
// the program (straight_functions.hpp) compute the same, to the last bit.
template <class P>
class Machine {
 public:
  using Array = HeapArray<P>;

  // `theta` and `u` must outlive the machine. After the first run, which gives all lanes values, functions compute the parts of
  // the packs that are in use alone, and lists the first part alone where no other is in use; the others keep theirs.
  Machine(const Program& program, const Shape<TapeModel>& shape, const Array& theta, const Array& u,
          int parts_in_use = PartsOf<P>::count)
      : program_(program),
        parts_in_use_(parts_in_use),
        straight_(fits(program.straight) ? program.straight : nullptr),
        own_(straight_ ? straight_->packs : program.registers - theta.size() - u.size()),
        at_(straight_ ? 0 : program.registers) {
    if (straight_) {
      leaves_ = {numbers_of(theta), numbers_of(u), nullptr, nullptr, nullptr};
      straight_->setup(&leaves_, numbers_of(own_), lanes_of<P>::width);
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
    carry_out<P>(program.setup, at_.data());
  }

  void run(const Array& x) {
    if (straight_) {
      leaves_.x = numbers_of(x);
      straight_->stage(&leaves_, numbers_of(own_), begun_ ? parts_in_use_ * native_lanes : lanes_of<P>::width);
      begun_ = true;
      return;
    }
    if (x.begin() != referred_) refer(x_, x);
    referred_ = x.begin();
    if (begun_ && parts_in_use_ == 1) return carry_out<PartOf<P>>(program_.stage, at_.data());
    carry_out<P>(program_.stage, at_.data());
    begun_ = true;
  }
  void run(const Array& x, const Array& side) {
    leaves_.side = numbers_of(side);
    if (!straight_)
      for (const P** place = side_; place != dx_; ++place) *place = &side[place - side_];
    run(x);
  }
  // The first outputs go to `out`, which is neither x nor side: what is computed for it alone is written there at once.
  void run(const Array& x, const Array& side, Array& out) {
    if (in_place_.empty() && copied_.empty()) find_in_place(static_cast<int>(out.size()));
    for (const int i : in_place_) at_[program_.outputs[i]] = &out[i];
    run(x, side);
    for (const int i : copied_) out[i] = output(i);
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
  // On the registers, or the first parts of them. Operations of one kind follow each other (schedule.py), and are decoded
  // together.
  template <class Q>
  [[gnu::noinline]] static void carry_out(const std::vector<Instruction>& instructions, const P* const* at) {
    using O = Operation;
    const Instruction *next = instructions.data(), *const end = next + instructions.size();
    while (next != end) {
      const O operation = next->operation;
      const auto all = [&](auto&& of) {
        do {
          const auto &a = read_as<Q>(*at[next->a]), &b = read_as<Q>(*at[next->b]), &c = read_as<Q>(*at[next->c]);
          write_as(const_cast<P&>(*at[next->out]), Q(of(a, b, c)));  // what is computed is our own
        } while (++next != end && next->operation == operation);
      };
      switch (operation) {
        case O::add:
          all([](const Q& a, const Q& b, const Q&) { return a + b; });
          break;
        case O::sub:
          all([](const Q& a, const Q& b, const Q&) { return a - b; });
          break;
        case O::mul:
          all([](const Q& a, const Q& b, const Q&) { return a * b; });
          break;
        case O::div:
          all([](const Q& a, const Q& b, const Q&) { return a / b; });
          break;
        case O::neg:
          all([](const Q& a, const Q&, const Q&) { return -a; });
          break;
        case O::mul_add:
          all([](const Q& a, const Q& b, const Q& c) { return fused(a, b, c); });
          break;
        case O::mul_sub:
          all([](const Q& a, const Q& b, const Q& c) { return fused(a, b, -c); });
          break;
        case O::sub_mul:
          all([](const Q& a, const Q& b, const Q& c) { return fused(-a, b, c); });
          break;
        case O::sqrt:
          all([](const Q& a, const Q&, const Q&) { return sqrt(a); });
          break;
        case O::exp:
          all([](const Q& a, const Q&, const Q&) { return exp(a); });
          break;
        case O::log:
          all([](const Q& a, const Q&, const Q&) { return log(a); });
          break;
        case O::sin:
          all([](const Q& a, const Q&, const Q&) { return sin(a); });
          break;
        case O::cos:
          all([](const Q& a, const Q&, const Q&) { return cos(a); });
          break;
        case O::tan:
          all([](const Q& a, const Q&, const Q&) { return tan(a); });
          break;
        case O::asin:
          all([](const Q& a, const Q&, const Q&) { return asin(a); });
          break;
        case O::acos:
          all([](const Q& a, const Q&, const Q&) { return acos(a); });
          break;
        case O::atan:
          all([](const Q& a, const Q&, const Q&) { return atan(a); });
          break;
        case O::sinh:
          all([](const Q& a, const Q&, const Q&) { return sinh(a); });
          break;
        case O::cosh:
          all([](const Q& a, const Q&, const Q&) { return cosh(a); });
          break;
        case O::tanh:
          all([](const Q& a, const Q&, const Q&) { return tanh(a); });
          break;
        case O::pow:
          all([](const Q& a, const Q& b, const Q&) { return power(a, b); });
          break;
        case O::abs:
          all([](const Q& a, const Q&, const Q&) { return abs(a); });
          break;
        case O::sign:
          all([](const Q& a, const Q&, const Q&) { return sign(a); });
          break;
        case O::min:
          all([](const Q& a, const Q& b, const Q&) { return min(a, b); });
          break;
        case O::max:
          all([](const Q& a, const Q& b, const Q&) { return max(a, b); });
          break;
        case O::select:
          all([](const Q& a, const Q& b, const Q& c) { return select(a > Q(0.0), b, c); });
          break;
        case O::accumulate:
          do {
            const Instruction* const behind = next + 1 + next->a;
            Q sum = first_of_sum<Q>(*++next, at);
            while (++next != behind) sum = add_term(*next, at, sum);
            write_as(const_cast<P&>(*at[next[-1].out]), sum);
          } while (next != end && next->operation == O::accumulate);
          break;
        case O::count:
          return;
      }
    }
  }
  template <class Q>
  [[gnu::always_inline]] static Q first_of_sum(const Instruction& i, const P* const* at) {
    using O = Operation;
    const auto &a = read_as<Q>(*at[i.a]), &b = read_as<Q>(*at[i.b]), &c = read_as<Q>(*at[i.c]);
    if (i.operation == O::mul) return a * b;
    if (i.operation == O::mul_add) return fused(a, b, c);
    if (i.operation == O::mul_sub) return fused(a, b, -c);
    if (i.operation == O::sub_mul) return fused(-a, b, c);
    return i.operation == O::add ? a + b : a - b;
  }
  template <class Q>
  [[gnu::always_inline]] static Q add_term(const Instruction& i, const P* const* at, const Q& sum) {
    using O = Operation;
    const auto &a = read_as<Q>(*at[i.a]), &b = read_as<Q>(*at[i.b]);
    if (i.operation == O::mul_add) return fused(a, b, sum);
    if (i.operation == O::sub_mul) return fused(-a, b, sum);
    return i.operation == O::add ? sum + b : sum - b;
  }

  // In place are those of the first n outputs that every stage makes, in a register that no output before them has.
  void find_in_place(int n) {
    HeapArray<bool> made(program_.registers);
    made.fill(false);
    if (!straight_)
      for (const Instruction& instruction : program_.stage) made[instruction.out] = true;
    for (int i = 0; i < n; ++i) (std::exchange(made[program_.outputs[i]], false) ? in_place_ : copied_).push_back(i);
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
  int parts_in_use_;
  bool begun_ = false;
  const FisherpointProgram* straight_;  // its functions, which do the work if there are any
  FisherpointLeaves leaves_{};
  Array own_;                           // literals and what is computed
  HeapArray<const P*> at_;              // where every register is
  const P **x_, **side_, **dx_;         // where the addresses of these leaves are
  const P* referred_ = nullptr;         // the first of the states that x_ refers to
  ShelfVector<int> in_place_, copied_;  // of the outputs, once there is a place for them
};

}  // namespace fisherpoint
