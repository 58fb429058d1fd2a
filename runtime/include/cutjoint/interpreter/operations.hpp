// The operations of interpreted programs.
#pragma once

#include <cstdint>
#include <string_view>

#include "cutjoint/core/roads/road.hpp"

namespace cutjoint::interpreter {

struct Instruction;

/// Performs an instruction in a memory, with the roads of the tyres.
using Perform = void (*)(const Instruction& instruction, double* memory, const Road<double>* roads);

/// An operation: the register of its result, and those of its arguments or, of a lookup, x, y and the number of the road.  With lanes each
/// is the first of as many adjacent registers.
struct Instruction {
  Perform perform;
  std::uint32_t to;
  std::uint32_t from[4];
};

/// An operation, and the number of its arguments.
struct Operation {
  Perform perform = nullptr;
  int arguments = 0;
};

/// The operation of a name, in each of 1, 2, 4 or 8 lanes; `perform` is null where there is none.
Operation find_operation(std::string_view name, int lanes);

}  // namespace cutjoint::interpreter
