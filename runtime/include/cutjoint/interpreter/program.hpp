// Programs as data: scheduled by the compiler (emit/interpreted.py), read and run instruction by instruction.
#pragma once

#include <vector>

#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/core/mechanism/loop_fits.hpp"
#include "cutjoint/interpreter/operations.hpp"
#include "cutjoint/json.hpp"

namespace cutjoint::interpreter {

/// An array among the arguments of a function.
struct Argument {
  const char* name;
  std::size_t length;
};

/// Registers of argument arrays, instructions, and registers of the result arrays' elements.
struct Function {
  struct Copied {
    std::size_t to, length;
  };
  std::vector<Copied> arguments;
  std::vector<Instruction> code;
  std::vector<std::vector<std::uint32_t>> results;
};

/// A program with its memory.  Running neither throws nor allocates.
class Program {
 public:
  explicit Program(const Json& document) : document_(document), memory_(document.at("image").get<std::vector<double>>()) {
    memory_.resize(document.at("registers").get<std::size_t>());
    for (const Json& o : document.at("operations")) {
      operations_.push_back(find_operation(o.at(0).get_ref<const std::string&>(), o.at(1).get<int>()));
      if (!operations_.back().perform) throw std::runtime_error("program: the operation " + o.dump() + " is unknown");
    }
  }

  bool has(const char* name) const { return document_.at("functions").contains(name); }

  /// The function of a name.
  Function read(const char* name, std::initializer_list<Argument> arguments, std::initializer_list<Argument> results) const {
    const Json& described = document_.at("functions").at(name);
    Function function{.arguments = {}, .code = read_code(described.at("code").get<std::vector<std::uint32_t>>()), .results = {}};
    for (const Argument& a : arguments) function.arguments.push_back({document_.at("arrays").at(a.name).get<std::size_t>(), a.length});
    for (const Argument& r : results) {
      auto& places = function.results.emplace_back();
      if (r.length > 0) places = described.at("results").at(r.name).get<std::vector<std::uint32_t>>();
    }
    return function;
  }

  /// A function that exists only if it has results; otherwise its arguments are ignored.
  Function read_if_any(const char* name, std::initializer_list<Argument> arguments, const Argument& result) const {
    if (result.length > 0) return read(name, arguments, {result});
    Function nothing;
    nothing.arguments.resize(arguments.size());
    nothing.results.resize(1);
    return nothing;
  }

  void use_roads(const Road<double>* roads) { roads_ = roads; }

  /// Call a function with the arrays that it was read with; null arguments leave their registers unchanged.
  void call(const Function& function, std::initializer_list<const double*> arguments, std::initializer_list<double*> results) {
    double* const memory = memory_.data();
    auto place = function.arguments.begin();
    for (const double* const argument : arguments) {
      if (argument) std::copy_n(argument, place->length, memory + place->to);
      ++place;
    }
    for (const Instruction& instruction : function.code) instruction.perform(instruction, memory, roads_);
    auto registers = function.results.begin();
    for (double* const result : results) {
      for (std::size_t i = 0; i < registers->size(); ++i) result[i] = memory[(*registers)[i]];
      ++registers;
    }
  }

 private:
  std::vector<Instruction> read_code(const std::vector<std::uint32_t>& numbers) const {
    std::vector<Instruction> code;
    for (auto at = numbers.begin(); at != numbers.end();) {
      const Operation& operation = operations_.at(*at++);
      Instruction& instruction = code.emplace_back(Instruction{operation.perform, *at++, {}});
      at = std::copy_n(at, operation.arguments, instruction.from) - instruction.from + at;
    }
    return code;
  }

  const Json& document_;
  std::vector<double> memory_;
  std::vector<Operation> operations_;
  const Road<double>* roads_ = nullptr;
};

/// The fits of loop embeddings, which `load` begins with.
class LoopFitsOfProgram {
 public:
  /// For a program with this number of parameters.
  LoopFitsOfProgram(const Program& program, const Json& document, std::size_t parameters) {
    if (!document.contains("fits")) return;
    std::size_t work = 0, count = 0;
    for (const Json& described : document.at("fits")) {
      Block& block = blocks_.emplace_back();
      for (const Json& coefficients : described.at("start")) {
        const std::size_t j = block.functions.size();
        block.functions.push_back({static_cast<int>(coefficients.size()), described.at("growth").at(j).get<double>()});
        for (const Json& c : coefficients) block.start.push_back(c.get<double>());
      }
      const std::size_t n = block.functions.size(), rows = described.at("rows").get<std::size_t>();
      block.loops = {.rows = static_cast<int>(rows), .functions = static_cast<int>(n), .nodes = described.at("nodes").get<int>(),
                     .is_periodic = described.at("is_periodic").get<bool>(), .middle = described.at("middle").get<double>(),
                     .half = described.at("half").get<double>(), .allowed = described.at("allowed").get<double>()};
      block.close = program.read(("close_" + std::to_string(blocks_.size() - 1)).c_str(), {{"parameters", parameters}, {"place", n + 1}},
                                 {{"opening", rows}, {"by_place", rows * (n + 1)}});
      work = std::max(work, static_cast<std::size_t>(work_of_fit(block.loops, block.functions.data())));
      count += block.start.size() + 1;
    }
    work_.resize(work);
    found_.resize(count);
  }

  std::size_t size() const { return found_.size(); }

  /// Find all coefficients, which are valid until the next call.
  const double* find(Program& program, const double* parameters) {
    double* found = found_.data();
    for (const Block& block : blocks_) {
      const auto close = [&](const double* place, double* opening, double* by_place) {
        program.call(block.close, {parameters, place}, {opening, by_place});
      };
      LoopFitting<double, decltype(close)>(block.loops, block.functions.data(), block.start.data(), work_.data(), close).find(found);
      found += block.start.size() + 1;
    }
    return found_.data();
  }

 private:
  struct Block {
    LoopFit loops{};
    std::vector<FittedFunction> functions;
    std::vector<double> start;
    Function close;
  };
  std::vector<Block> blocks_;
  std::vector<double> work_, found_;
};

/// The functions that depend on time and inputs, evaluated when a step begins, and the source of inputs.
class StepBeginning {
 public:
  StepBeginning(const Program& program, const Json& document) : values_(document.at("inputs").get<std::size_t>()) {
    const Argument t{"t", 1}, input{"input", values_.size()};
    scene_inputs_ = program.read_if_any("scene_inputs", {t}, input);
    begin_step_ = program.read("begin_step", {t, {"motion", 1}, input}, {});
  }

  void drive_by(const InputSource<double>& source) { source_ = source; }

  void begin_step(Program& program, double t, double motion) {
    program.call(scene_inputs_, {&t}, {values_.data()});
    if (source_.fill) source_.fill(source_.host, t, values_.data());
    program.call(begin_step_, {&t, &motion, values_.data()}, {});
  }

 private:
  std::vector<double> values_;
  InputSource<double> source_;
  Function scene_inputs_, begin_step_;
};

}  // namespace cutjoint::interpreter
