// Programs: lists of operations on registers, which equations/tape_machine.hpp carries out.
#pragma once

#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "fisherpoint/models/straight_functions.hpp"

namespace fisherpoint {

enum class Operation : std::int32_t {
  add,
  sub,
  mul,
  div,
  neg,
  mul_add,  // a b + c
  mul_sub,  // a b - c
  sub_mul,  // c - a b
  sqrt,
  exp,
  log,
  sin,
  cos,
  tan,
  asin,
  acos,
  atan,
  sinh,
  cosh,
  tanh,
  pow,
  abs,
  sign,  // -1, 0 or 1
  min,
  max,
  select,  // a > 0 ? b : c
  count,
  accumulate  // stands in front of operations that make one sum, term by term; a: how many (mark_sums)
};

inline constexpr const char* operation_names[] = {"add",  "sub",  "mul", "div", "neg",  "mul_add", "mul_sub", "sub_mul", "sqrt",
                                                  "exp",  "log",  "sin", "cos", "tan",  "asin",    "acos",    "atan",    "sinh",
                                                  "cosh", "tanh", "pow", "abs", "sign", "min",     "max",     "select"};
static_assert(std::size(operation_names) == static_cast<std::size_t>(Operation::count));

struct Instruction {
  Operation operation;
  std::int32_t out, a, b, c;  // registers
};

// Registers, in this order: literals, theta, u, x, side, dx (the rate at which x moves, where the program asks for it), then
// what is computed.
struct Program {
  std::vector<double> literals;
  std::vector<Instruction> setup;  // once for a trajectory: reads neither x nor side nor dx
  std::vector<Instruction> stage;  // once for every x
  std::vector<std::int32_t> outputs;
  std::int32_t registers;
  const FisherpointProgram* straight = nullptr;  // functions that do the same on packs of one width and level, if any
};

// Whether an operation adds a term to a sum, and does not read it otherwise.
inline bool adds_to(std::int32_t sum, const Instruction& i) {
  switch (i.operation) {
    case Operation::mul_add:
    case Operation::sub_mul:
      return i.out == sum && i.c == sum && i.a != sum && i.b != sum;
    case Operation::add:
    case Operation::sub:
      return i.out == sum && i.a == sum && i.b != sum;
    default:
      return false;
  }
}
inline bool may_begin_sum(Operation operation) {
  using enum Operation;
  for (const Operation one : {add, sub, mul, mul_add, mul_sub, sub_mul})
    if (operation == one) return true;
  return false;
}

// Marks operations that follow each other and make one sum in one register: it need not be stored before it is whole.
inline void mark_sums(std::vector<Instruction>& instructions) {
  std::vector<Instruction> marked;
  for (auto first = instructions.begin(); first != instructions.end();) {
    auto end = first + 1;
    if (may_begin_sum(first->operation))
      while (end != instructions.end() && adds_to(first->out, *end)) ++end;
    if (end - first > 1) marked.push_back({Operation::accumulate, first->out, static_cast<std::int32_t>(end - first), 0, 0});
    marked.insert(marked.end(), first, end);
    first = end;
  }
  instructions = std::move(marked);
}

}  // namespace fisherpoint
