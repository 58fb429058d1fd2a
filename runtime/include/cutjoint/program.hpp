// A program around a run: one argument, the run file; errors as text; the exit status.
#pragma once

#include <new>

#include "cutjoint/json.hpp"
#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint {

template <class Real>
class AnySystem;

/// Do the task of a run file and return its summary: `start` finds the initial state, `mechanism` continues.
Json perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism);

/// Do the task of a run file by a Lagrangian method.
Json perform(const Json& file, AnyMechanism<double>& start, AnySystem<Precision>& system);

/// A message on one line, with control characters escaped.
inline std::string printable(std::string_view text) {
  constexpr char digits[] = "0123456789abcdef";
  std::string printed;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool wide = byte == 0xc2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xa0;
    const unsigned char shown = wide ? static_cast<unsigned char>(text[++i]) : byte;
    if (wide || byte < 0x20 || byte == 0x7f) printed.append("\\x").append({digits[shown / 16], digits[shown % 16]});
    else printed.push_back(text[i]);
  }
  return printed;
}

/// Calls `perform` with the content of the run file and prints the summary that it returns.
/// Exit status 0 when done, 1 when the run failed numerically or was interrupted, 2 when it could not begin or a file could not be written.
/// With "ends_with_stdin" in the run file, the program ends when its standard input does.
int run_program(int argc, char** argv, const char* name, auto perform) {
  try {
    if (argc != 2) throw std::runtime_error(std::string("usage: ") + name + " RUN.json");
    const Json file = read_json(argv[1]);
    report_write_errors();
    if (file.value("ends_with_stdin", false)) stop_with_standard_input();
    const Json summary = perform(file);
    std::cout << summary << std::endl;
    return summary.at("status") == "done" ? 0 : 1;
  } catch (const std::bad_alloc&) {
    std::cerr << "error: the run needs more memory than there is; write an earlier end, or a larger dt or output_step" << std::endl;
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "error: " << printable(error.what()) << std::endl;
    return 2;
  }
}

}  // namespace cutjoint
