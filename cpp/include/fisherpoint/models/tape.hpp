// A model given as lists of operations, which are interpreted: what a user writes in Python, at the engine's speed without a
// compiler.
//
// An operation costs the same to decode whether it works on one lane or on a hundred, so the lists are run over wide packs; the
// integrator, the plans and the variational equation are those of the compiled models. Expressions are simplified,
// differentiated and shared in Python (fisherpoint.tape); here they are only carried out.
#pragma once

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "fisherpoint/models/column_patterns.hpp"
#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/models/program.hpp"
#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/models/straight_functions.hpp"
#include "fisherpoint/numbers/implicit_orders.hpp"

namespace fisherpoint {

class TapeModel;

template <>
struct Shape<TapeModel> {
  int states, inputs, outputs, parameters;
  int jumps_end, kinks_end, sides, surfaces;
  bool sided_limits = false;  // limits read sides: they stand in branches
  int measured = 0;           // limits behind the surfaces, which hold where g is measured
  int resets = 0;
  int updates = 0;
  int holds_end = 0;  // of jumps and kinks that may hold trajectories, which come first; of a model it is made from `Varying`
  static constexpr int values = -1;        // surfaces and what is measured, of a number that is not known here
  static constexpr bool unrolled = false;  // packs are so wide that unrolled loops would only overflow the instruction cache
};

// An entry of a Jacobian: the derivative of function `row` in `variable`, the states first, then the parameters.
struct Entry {
  int row, variable;
};

// Which states, outputs, and jumps and kinks depend on theta in whatever way, by branches too: not those without a derivative
// alone. And which jumps trajectories may cross, and beside which jumps and kinks f_x may be rough or without bounds, and of
// the entries of f's Jacobian, which are constant along a trajectory (Dependence).
struct Varying {
  std::vector<bool> states, outputs, surfaces, crossable, rough, steep, closed, constant_slopes;
};

template <>
class Dependence<TapeModel> {
 public:
  Dependence(const Shape<TapeModel>& shape, const std::vector<Entry>& rate_entries, Varying varying)
      : coupled_(shape.states, shape.states),
        driven_(shape.parameters, shape.states),
        rows_(shape.parameters, shape.states),
        row_(shape.states, shape.parameters),
        sensitive_(1, shape.states),
        surfaces_(shape.surfaces),
        varying_(std::move(varying)) {
    for (const auto [i, k] : rate_entries) {
      if (k < shape.states) {
        coupled_.add(i, k);
      } else {
        row_.add(i, k - shape.states);
        driven_.add(k - shape.states, i);
      }
    }
    // Which parameters state i depends on in the end: those that f_i reads and those of the states that it reads.
    for (bool more = true; more;) {
      more = false;
      for (int i = 0; i < shape.states; ++i) for_each_variable(coupled_[i], [&](int k) { more = row_.join(i, k) || more; });
    }
    for (int i = 0; i < shape.states; ++i) for_each_variable(row_[i], [&](int j) { rows_.add(j, i), sensitive_.add(0, i); });
    const auto starts = [](const VariableSets& sets, int count, std::vector<int>& start) {
      int at = 0;
      for (int set = 0; set < count; ++set) start.push_back(at), at += detail::size_of(sets[set]);
      return at;
    };
    by_state = starts(coupled_, shape.states, state_start);
    by_theta = starts(driven_, shape.parameters, theta_start) + 1;
    in_columns = starts(rows_, shape.parameters, column_start);
    const auto drive = [&](int j, int i) { return detail::has(driven_[j], i) ? drive_at(j, i) : by_theta - 1; };
    patterns = column_patterns(rows_, coupled_, shape.parameters, state_start, drive);
    varying_outputs = static_cast<int>(std::count(varying_.outputs.begin(), varying_.outputs.end(), true));
    places_kept_.at.resize(rate_entries.size());
    for (const bool constant_slope : varying_.constant_slopes) places_kept_.add(constant_slope);
    changing = places_kept_.changing, constant = places_kept_.constant;
  }

  VariableSet rows(int j) const { return rows_[j]; }
  VariableSet driven(int j) const { return driven_[j]; }
  VariableSet driven_in_group(int j) const { return driven_[j]; }
  int drive_at(int j, int i) const { return theta_start[j] + detail::below(driven_[j], i); }
  VariableSet coupled(int i) const { return coupled_[i]; }
  VariableSet sensitive() const { return sensitive_[0]; }
  bool depends(int i, int j) const { return detail::has(row_[i], j); }
  bool state_depends(int i) const { return varying_.states[i]; }
  bool output_depends(int i) const { return varying_.outputs[i]; }
  bool switching_depends(int m) const { return varying_.surfaces[m]; }
  bool crossable(int m) const { return varying_.crossable[m]; }
  bool rough(int m) const { return m >= static_cast<int>(varying_.rough.size()) || varying_.rough[m]; }
  bool steep(int m) const { return varying_.steep[m]; }
  bool closed(int m) const { return varying_.closed[varying_.closed.size() - (surfaces_ - m)]; }  // of limits behind the poles
  bool any_closed() const { return std::find(varying_.closed.begin(), varying_.closed.end(), true) != varying_.closed.end(); }
  bool any_steep() const { return std::find(varying_.steep.begin(), varying_.steep.end(), true) != varying_.steep.end(); }
  int leader(int j) const { return j; }
  int kept_at(int e) const { return places_kept_.at[e]; }
  int next_alike(int) const { return static_cast<int>(column_start.size()); }

  int by_state, by_theta, in_columns, varying_outputs;  // by_theta counts the zero behind the entries too
  int changing, constant;                               // entries of f_x and f_theta along a trajectory
  std::vector<int> state_start, theta_start, column_start;
  std::vector<ColumnPattern> patterns;

 private:
  VariableSets coupled_, driven_, rows_, row_, sensitive_;
  detail::PlacesKept<std::vector<int>> places_kept_;
  int surfaces_;
  Varying varying_;
};

// The surfaces' values, their rates along dx, f with its Jacobian, ...: one program each.
struct TapePrograms {
  Program rates, output, surfaces, surface_rates;
  Program state_jacobian;   // the entries of f_x row by row, those that S does not need too
  Program rate_jacobian;    // f, then the entries of f_x row by row, then those of f_theta column by column
  Program output_jacobian;  // g, then the entries of g_x row by row, then those of g_theta column by column
  Program
      jump_jacobian;  // h of jumps and of steep kinks, which come first, then the entries of its derivatives in the same way
};

// What sets states anew, see integration/resets.hpp: the conditions, then the values of the targets.
struct TapeResets {
  Program program;             // reads sides in the conditions alone
  Program jacobian;            // the targets' values, then their derivatives at the entries
  std::vector<Entry> targets;  // (reset, state)
  std::vector<Entry> entries;  // (target, variable)
  std::vector<bool> by_level;  // of every reset, whether it counts at a start too where its condition holds
};

// What sets states anew at known times, at the starts of segments of runs (kernels/runs.hpp).
struct TapeUpdates {
  Program program;             // the values of the targets
  Program jacobian;            // these, then their derivatives at the entries
  std::vector<Entry> targets;  // (update, state)
  std::vector<Entry> entries;  // (target, variable)
};

class TapeModel {
 public:
  // Throws std::invalid_argument where a list does not fit the shape.
  TapeModel(const Shape<TapeModel>& shape, std::vector<double> scales, TapePrograms programs, std::vector<Entry> state_entries,
            std::vector<Entry> rate_entries, std::vector<Entry> output_entries, std::vector<Entry> jump_entries,
            Varying varying, TapeResets resets = {}, TapeUpdates updates = {});

  const Shape<TapeModel>& shape() const { return shape_; }
  const Dependence<TapeModel>& dependence() const { return dependence_; }
  const TapePrograms& programs() const { return programs_; }
  const std::vector<Entry>& state_entries() const { return state_entries_; }
  const std::vector<Entry>& output_entries() const { return output_entries_; }
  const std::vector<Entry>& jump_entries() const { return jump_entries_; }
  const TapeResets& resets() const { return resets_; }
  const TapeUpdates& updates() const { return updates_; }
  double inverse_scale(int i) const { return inverse_scales_[i]; }
  const ImplicitOrders& orders() const { return orders_; }
  int gradients_end() const { return static_cast<int>(programs_.jump_jacobian.outputs.size() - jump_entries_.size()); }

 protected:
  // Functions that do what the lists say; they must outlive the model and its copies.
  void attach(const FisherpointPrograms& functions) {
    programs_.rates.straight = &functions.rates;
    programs_.output.straight = &functions.output;
    programs_.surfaces.straight = &functions.surfaces;
    programs_.surface_rates.straight = &functions.surface_rates;
    programs_.state_jacobian.straight = &functions.state_jacobian;
    programs_.rate_jacobian.straight = &functions.rate_jacobian;
    programs_.output_jacobian.straight = &functions.output_jacobian;
    programs_.jump_jacobian.straight = &functions.jump_jacobian;
    resets_.program.straight = &functions.resets;
    resets_.jacobian.straight = &functions.reset_jacobian;
    updates_.program.straight = &functions.updates;
    updates_.jacobian.straight = &functions.update_jacobian;
  }

 private:
  Shape<TapeModel> shape_;
  std::vector<double> inverse_scales_;
  TapePrograms programs_;
  std::vector<Entry> state_entries_, output_entries_, jump_entries_;
  TapeResets resets_;
  TapeUpdates updates_;
  Dependence<TapeModel> dependence_;
  ImplicitOrders orders_;
};

inline const Shape<TapeModel>& shape_of(const TapeModel& model) { return model.shape(); }
inline const Dependence<TapeModel>& dependence_of(const TapeModel& model) { return model.dependence(); }
inline double inverse_scale(const TapeModel& model, int i) { return model.inverse_scale(i); }

namespace detail {

inline void expect(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

// Whether any operation or result of a program is of a side.
inline bool reads_sides(const Program& program, const Shape<TapeModel>& shape) {
  const auto first = static_cast<std::int32_t>(program.literals.size()) + shape.parameters + shape.inputs + shape.states;
  const auto is_side = [&](std::int32_t r) { return first <= r && r < first + shape.kinks_end; };
  const auto reads = [&](const Instruction& i) { return is_side(i.a) || is_side(i.b) || is_side(i.c); };
  return std::any_of(program.setup.begin(), program.setup.end(), reads) ||
         std::any_of(program.stage.begin(), program.stage.end(), reads) ||
         std::any_of(program.outputs.begin(), program.outputs.end(), is_side);
}

// A program that reads or writes past its registers, or that spoils what its setup computed, is none.
inline void check(const Program& program, const Shape<TapeModel>& shape, std::size_t outputs, const std::string& name) {
  const auto setup_leaves = static_cast<std::int32_t>(program.literals.size()) + shape.parameters + shape.inputs;
  const auto leaves = setup_leaves + 2 * shape.states + shape.kinks_end;
  expect(program.registers >= leaves, name + ".registers: expected at least the leaves, given fewer");
  expect(program.outputs.size() == outputs,
         name + ".outputs: expected " + std::to_string(outputs) + ", given " + std::to_string(program.outputs.size()));
  std::vector<bool> known(program.registers, false), kept(program.registers, false);
  for (std::int32_t r = 0; r < leaves; ++r) kept[r] = known[r] = true;
  for (std::int32_t r = setup_leaves; r < leaves; ++r) known[r] = false;
  const auto run = [&](const std::vector<Instruction>& instructions) {
    for (const Instruction& i : instructions) {
      const bool valid = i.operation >= Operation::add && i.operation < Operation::count;
      expect(valid, name + ": expected an operation, given " + std::to_string(static_cast<int>(i.operation)));
      for (const auto r : {i.a, i.b, i.c})
        expect(r >= 0 && r < program.registers && (known[r] || r == 0), name + ": expected a register that has a value");
      expect(i.out >= 0 && i.out < program.registers && !kept[i.out], name + ": expected a register that may be written");
      known[i.out] = true;
    }
  };
  run(program.setup);
  for (std::int32_t r = 0; r < program.registers; ++r) kept[r] = kept[r] || known[r];
  for (std::int32_t r = setup_leaves; r < leaves; ++r) known[r] = true;
  run(program.stage);
  for (const auto r : program.outputs)
    expect(r >= 0 && r < program.registers && known[r], name + ".outputs: expected registers that have a value");
}

}  // namespace detail

inline TapeModel::TapeModel(const Shape<TapeModel>& shape, std::vector<double> scales, TapePrograms programs,
                            std::vector<Entry> state_entries, std::vector<Entry> rate_entries,
                            std::vector<Entry> output_entries, std::vector<Entry> jump_entries, Varying varying,
                            TapeResets resets, TapeUpdates updates)
    : shape_([&] {
        Shape<TapeModel> whole = shape;
        const auto& steep = varying.steep;
        whole.holds_end = shape.jumps_end;
        for (std::size_t m = shape.jumps_end; m < steep.size() && steep[m]; ++m) ++whole.holds_end;
        return whole;
      }()),
      inverse_scales_(std::move(scales)),
      programs_(std::move(programs)),
      state_entries_(std::move(state_entries)),
      output_entries_(std::move(output_entries)),
      jump_entries_(std::move(jump_entries)),
      resets_(std::move(resets)),
      updates_(std::move(updates)),
      dependence_([&] {
        using detail::expect;
        const auto [n_x, n_u, n_y, p, jumps_end, kinks_end, sides, surfaces, sided_limits, measured, n_resets, n_updates,
                    n_holds] = shape_;
        expect(sided_limits || !detail::reads_sides(programs_.surfaces, shape),
               "surfaces: expected sides to be read as the shape says");
        expect(n_u >= 0 && n_y >= 0 && p >= 0, "model: expected numbers of inputs, outputs and parameters, given less than 0");
        expect(measured >= 0, "measured: expected a number of limits, given less than 0");
        expect(0 <= jumps_end && jumps_end <= kinks_end && kinks_end <= sides && sides <= surfaces,
               "model: expected jumps, kinks, poles and limits in this order");
        expect(static_cast<int>(inverse_scales_.size()) == n_x, "scales: expected one for every state");
        expect(static_cast<int>(varying.states.size()) == n_x && static_cast<int>(varying.outputs.size()) == n_y &&
                   static_cast<int>(varying.surfaces.size()) == kinks_end &&
                   static_cast<int>(varying.crossable.size()) == jumps_end &&
                   static_cast<int>(varying.rough.size()) == kinks_end && static_cast<int>(varying.steep.size()) == kinks_end,
               "varying: expected one for every state, output, and jump and kink, crossable one for every jump, and rough and "
               "steep one for every jump and kink");
        const auto check_entries = [&](const std::vector<Entry>& entries, int rows, const char* name) {
          for (std::size_t e = 0; e < entries.size(); ++e) {
            const auto [i, k] = entries[e];
            expect(i >= 0 && i < rows && k >= 0 && k < n_x + p, std::string(name) + ": expected entries of the Jacobian");
            if (e == 0) continue;
            const auto [i0, k0] = entries[e - 1];
            const bool state = k < n_x, state0 = k0 < n_x;
            expect(state0 != state ? state0
                   : state         ? i0 < i || (i0 == i && k0 < k)
                                   : k0 < k || (k0 == k && i0 < i),
                   std::string(name) + ": expected those of the states by rows, then those of the parameters by columns");
          }
        };
        check_entries(state_entries_, n_x, "state_entries");
        for (const auto [i, k] : state_entries_) expect(k < n_x, "state_entries: expected derivatives by the states");
        check_entries(rate_entries, n_x, "rate_entries");
        check_entries(output_entries_, n_y, "output_entries");
        expect(varying.constant_slopes.size() == rate_entries.size(), "constant_slopes: expected one for every entry");
        expect(static_cast<int>(varying.closed.size()) == surfaces - sides,
               "closed: expected one for every limit behind the poles");
        expect(std::find(varying.steep.begin() + n_holds, varying.steep.end(), true) == varying.steep.end(),
               "varying.steep: expected steep kinks before others");
        check_entries(jump_entries_, n_holds, "jump_entries");
        detail::check(programs_.rates, shape, n_x, "rates");
        detail::check(programs_.output, shape, n_y, "output");
        detail::check(programs_.surfaces, shape, surfaces + measured, "surfaces");
        detail::check(programs_.surface_rates, shape, surfaces + measured, "surface_rates");
        detail::check(programs_.state_jacobian, shape, state_entries_.size(), "state_jacobian");
        detail::check(programs_.rate_jacobian, shape, n_x + rate_entries.size(), "rate_jacobian");
        detail::check(programs_.output_jacobian, shape, n_y + output_entries_.size(), "output_jacobian");
        detail::check(programs_.jump_jacobian, shape, n_holds + jump_entries_.size(), "jump_jacobian");
        expect(0 <= n_resets && n_resets <= most_resets, "resets: expected at most 32, given more");
        expect(0 <= n_updates && n_updates <= most_resets, "updates: expected at most 32, given more");
        const auto check_targets = [&](const auto& of, int count, const std::string& name) {
          for (const auto [k, i] : of.targets)
            expect(k >= 0 && k < count && i >= 0 && i < n_x, name + "_targets: expected pairs of one of them and a state");
          for (const auto [t, k] : of.entries)
            expect(t >= 0 && t < static_cast<int>(of.targets.size()) && k >= 0 && k < n_x + p,
                   name + "_entries: expected entries of the Jacobian");
          if (count > 0) detail::check(of.jacobian, shape, of.targets.size() + of.entries.size(), name + "_jacobian");
        };
        check_targets(resets_, n_resets, "reset");
        check_targets(updates_, n_updates, "update");
        if (n_updates > 0) detail::check(updates_.program, shape, updates_.targets.size(), "updates");
        expect(static_cast<int>(resets_.by_level.size()) == n_resets, "reset_levels: expected one for every reset");
        if (n_resets > 0) detail::check(resets_.program, shape, n_resets + resets_.targets.size(), "resets");
        return Dependence<TapeModel>(shape, rate_entries, std::move(varying));
      }()),
      orders_([&] {
        std::vector<std::pair<int, int>> entries;
        for (const auto [i, k] : state_entries_) entries.emplace_back(i, k);
        return ImplicitOrders(shape_.states, entries);
      }()) {
  for (double& scale : inverse_scales_) scale = 1.0 / scale;
  for (Program* program :
       {&programs_.rates, &programs_.output, &programs_.surfaces, &programs_.surface_rates, &programs_.state_jacobian,
        &programs_.rate_jacobian, &programs_.output_jacobian, &programs_.jump_jacobian, &resets_.program, &resets_.jacobian,
        &updates_.program, &updates_.jacobian})
    mark_sums(program->stage);
}

}  // namespace fisherpoint
