// Expressions of a model: trees flattened to instructions over one register file, run without allocation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint::generic {

using Json = nlohmann::ordered_json;

/// The operation of an instruction; a comparison yields 1 or 0.
enum class Operation : std::uint8_t {
  add, sub, mul, div, neg, sqrt, sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, exp, log, abs, pow,
  lt, le, logical_and, logical_or, logical_not, where
};

/// The operation that a tree names.
inline Operation operation_of(const std::string& name) {
  static const std::map<std::string, Operation> operations = {
      {"add", Operation::add}, {"sub", Operation::sub}, {"mul", Operation::mul}, {"div", Operation::div},
      {"neg", Operation::neg}, {"sqrt", Operation::sqrt}, {"sin", Operation::sin}, {"cos", Operation::cos},
      {"tan", Operation::tan}, {"asin", Operation::asin}, {"acos", Operation::acos}, {"atan", Operation::atan},
      {"atan2", Operation::atan2}, {"sinh", Operation::sinh}, {"cosh", Operation::cosh}, {"tanh", Operation::tanh},
      {"exp", Operation::exp}, {"log", Operation::log}, {"abs", Operation::abs}, {"pow", Operation::pow},
      {"lt", Operation::lt}, {"le", Operation::le}, {"and", Operation::logical_and}, {"or", Operation::logical_or},
      {"not", Operation::logical_not}, {"where", Operation::where}};
  const auto found = operations.find(name);
  if (found == operations.end()) throw std::runtime_error("unknown operation '" + name + "' in an expression");
  return found->second;
}

/// A part of the instructions that run at each evaluation.
struct Routine {
  std::size_t first = 0, last = 0;
};

/// All expressions of a model.  Instructions on parameters alone run when these are loaded, those on time and on inputs when a step begins,
/// the others in routines.  Equal expressions share a register.  Inputs come from the scene's laws, which depend on parameters and time, and
/// from a source.
template <class Real>
class Expressions {
 public:
  explicit Expressions(std::size_t parameters, const Json& inputs = Json::array()) : parameters_(parameters) {
    for (std::size_t i = 0; i < parameters; ++i) make_register(Stage::load);
    names_["t"] = time_ = make_register(Stage::time);
    names_["motion"] = motion_ = make_register(Stage::step);
    for (const Json& input : inputs)
      for (const Json& law : input.at("law")) laws_.push_back(read(law));
    input_.resize(laws_.size());
    for (std::size_t i = 0; i < laws_.size(); ++i) inputs_.push_back(make_register(Stage::step));
  }

  void drive_by(const InputSource<Real>& source) { source_ = source; }

  /// A register that the caller sets before a routine runs; trees read from now on know it by this name.
  int variable(const std::string& name) { return names_[name] = make_register(Stage::routine); }

  /// The register that will hold the value of a tree: a number, ["p", i], ["u", i], ["t"], ["motion"] (0 where the mechanism is held at rest,
  /// else 1), another [variable], or [operation, tree ...].
  int read(const Json& tree) {
    if (tree.is_number()) return constant(tree.get<double>());
    const std::string name = tree.at(0);
    if (name == "p") return parameter(tree.at(1).get<std::size_t>());
    if (name == "u") return inputs_.at(tree.at(1).get<std::size_t>());
    if (tree.size() == 1) return names_.at(name);
    if (name == "pow" && tree.at(2).is_number()) return power(read(tree.at(1)), tree.at(2).get<double>());
    std::array<int, 3> arguments{-1, -1, -1};
    for (std::size_t i = 1; i < tree.size(); ++i) arguments.at(i - 1) = read(tree.at(i));
    return emit(operation_of(name), arguments);
  }

  /// The instructions that `read_trees` adds.
  template <class ReadTrees>
  Routine routine(ReadTrees&& read_trees) {
    const std::size_t first = running_.size();
    read_trees();
    return {first, running_.size()};
  }

  void load(const Real* parameters) {
    std::copy_n(parameters, parameters_, registers_.begin());
    for (const Instruction& i : loading_) execute(i);
  }

  void begin_step(Real t, Real motion) {
    set(time_, t);
    set(motion_, motion);
    for (const Instruction& i : timing_) execute(i);
    fill_inputs(t);
    for (const Instruction& i : stepping_) execute(i);
  }

  void run(Routine routine) {
    for (std::size_t i = routine.first; i < routine.last; ++i) execute(running_[i]);
  }

  void set(int at, Real value) { registers_[static_cast<std::size_t>(at)] = value; }
  Real operator[](int at) const { return registers_[static_cast<std::size_t>(at)]; }

  /// True if a register holds a number that neither parameters nor time change.
  bool is_number(int at) const {
    return std::any_of(constants_.begin(), constants_.end(), [at](const auto& constant) { return constant.second == at; });
  }

  /// True if a register holds this number at all values of the parameters.
  bool is_constant(int at, double value) const {
    const auto found = constants_.find(value);
    return found != constants_.end() && found->second == at;
  }

 private:
  enum class Stage : std::uint8_t { load, time, step, routine };

  struct Instruction {
    Operation operation;
    int result;
    std::array<int, 3> arguments;
  };

  int make_register(Stage stage, Real value = Real(0)) {
    registers_.push_back(value);
    stages_.push_back(stage);
    return static_cast<int>(registers_.size()) - 1;
  }

  int constant(double value) {
    const auto found = constants_.find(value);
    return found != constants_.end() ? found->second : constants_[value] = make_register(Stage::load, Real(value));
  }

  int parameter(std::size_t i) const {
    if (i >= parameters_) throw std::runtime_error("an expression names a parameter that the model does not list");
    return static_cast<int>(i);
  }

  /// A power with a whole exponent by squaring, a half by the root.
  int power(int base, double exponent) {
    if (exponent == 0.5) return emit(Operation::sqrt, {base, -1, -1});
    if (exponent != std::floor(exponent) || std::abs(exponent) > 64) return emit(Operation::pow, {base, constant(exponent), -1});
    const int n = static_cast<int>(std::abs(exponent));
    if (exponent < 0) return emit(Operation::div, {constant(1.0), power(base, n), -1});
    if (n < 2) return n == 0 ? constant(1.0) : base;
    const int half = power(base, n / 2), square = emit(Operation::mul, {half, half, -1});
    return n % 2 ? emit(Operation::mul, {square, base, -1}) : square;
  }

  int emit(Operation operation, std::array<int, 3> arguments) {
    const std::array<int, 4> key{static_cast<int>(operation), arguments[0], arguments[1], arguments[2]};
    const auto found = known_.find(key);
    if (found != known_.end()) return found->second;
    Stage stage = Stage::load;
    for (const int a : arguments)
      if (a >= 0) stage = std::max(stage, stages_[static_cast<std::size_t>(a)]);
    const int result = make_register(stage);
    code_of(stage).push_back({operation, result, arguments});
    return known_[key] = result;
  }

  std::vector<Instruction>& code_of(Stage stage) {
    switch (stage) {
      case Stage::load: return loading_;
      case Stage::time: return timing_;
      case Stage::step: return stepping_;
      case Stage::routine: return running_;
    }
    return running_;
  }

  void fill_inputs(Real t) {
    for (std::size_t i = 0; i < laws_.size(); ++i) input_[i] = (*this)[laws_[i]];
    if (source_.fill) source_.fill(source_.host, t, input_.data());
    for (std::size_t i = 0; i < inputs_.size(); ++i) set(inputs_[i], input_[i]);
  }

  void execute(const Instruction& i) {
    const auto at = [&](std::size_t n) { return registers_[static_cast<std::size_t>(i.arguments[n])]; };
    registers_[static_cast<std::size_t>(i.result)] = value(i.operation, at);
  }

  template <class At>
  static Real value(Operation operation, At at) {
    using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cos, std::cosh, std::exp, std::log, std::pow, std::sin, std::sinh,
        std::sqrt, std::tan, std::tanh;
    const auto truth = [](bool holds) { return holds ? Real(1) : Real(0); };
    switch (operation) {
      case Operation::add: return at(0) + at(1);
      case Operation::sub: return at(0) - at(1);
      case Operation::mul: return at(0) * at(1);
      case Operation::div: return at(0) / at(1);
      case Operation::neg: return -at(0);
      case Operation::sqrt: return sqrt(at(0));
      case Operation::sin: return sin(at(0));
      case Operation::cos: return cos(at(0));
      case Operation::tan: return tan(at(0));
      case Operation::asin: return asin(at(0));
      case Operation::acos: return acos(at(0));
      case Operation::atan: return atan(at(0));
      case Operation::atan2: return atan2(at(0), at(1));
      case Operation::sinh: return sinh(at(0));
      case Operation::cosh: return cosh(at(0));
      case Operation::tanh: return tanh(at(0));
      case Operation::exp: return exp(at(0));
      case Operation::log: return log(at(0));
      case Operation::abs: return abs(at(0));
      case Operation::pow: return pow(at(0), at(1));
      case Operation::lt: return truth(at(0) < at(1));
      case Operation::le: return truth(at(0) <= at(1));
      case Operation::logical_and: return truth(at(0) != Real(0) && at(1) != Real(0));
      case Operation::logical_or: return truth(at(0) != Real(0) || at(1) != Real(0));
      case Operation::logical_not: return truth(at(0) == Real(0));
      case Operation::where: return at(0) != Real(0) ? at(1) : at(2);
    }
    return Real(0);
  }

  std::size_t parameters_;
  int time_, motion_;
  std::vector<Real> registers_;
  std::vector<Stage> stages_;
  std::vector<Instruction> loading_, timing_, stepping_, running_;
  std::vector<int> laws_, inputs_;
  std::vector<Real> input_;
  InputSource<Real> source_;
  std::map<std::string, int> names_;
  std::map<double, int> constants_;
  std::map<std::array<int, 4>, int> known_;
};

}  // namespace cutjoint::generic
