// The functions of the generic system at given states: `generic_natural TASK.json`, results (JSON) on standard output.
// Counts allocations in them: malloc itself is interposed, since not all code goes through operator new.
#include <cstdlib>
#include <vector>

#include "cutjoint/generic/natural/system.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/run_file.hpp"

extern "C" void* __libc_malloc(std::size_t size);

namespace {

long allocations = 0;

using cutjoint::Json;
using System = cutjoint::generic::natural::GenericSystem<double>;
using Array = std::vector<double>;

Array read(const Json& state, const char* key) { return state.at(key).get<Array>(); }

Json evaluate(System& system, const Json& state) {
  const cutjoint::SystemDescription& d = system.description();
  const Array q = read(state, "q"), v = read(state, "v"), vdot = read(state, "vdot"), lambda = read(state, "lambda"), w = read(state, "w");
  const Array relative_q = read(state, "relative_q"), relative_v = read(state, "relative_v"), weights = read(state, "weights");
  const double t = state.at("t"), motion = state.at("motion"), penalty = state.at("penalty");
  const std::size_t n = d.coordinates.size(), m = d.equations.size();
  Array placed_q(n), placed_v(n), balance(n), residual(m), linear_balance(n), linear_residual(m), phi(m), rate(m), curvature(m), force(n);
  Array tangent(d.pattern.row.size()), column(d.columns.size());
  const long before = allocations;
  system.begin_step(t, motion);
  system.initial_coordinates(relative_q.data(), relative_v.data(), placed_q.data(), placed_v.data());
  system.dynamic_residual(q.data(), v.data(), vdot.data(), lambda.data(), penalty, balance.data(), residual.data());
  system.linearise(q.data(), v.data(), vdot.data(), lambda.data(), penalty, {weights[0], weights[1], weights[2]}, linear_balance.data(),
                   linear_residual.data(), tangent.data());
  system.constraint_residual(q.data(), v.data(), vdot.data(), phi.data(), rate.data(), curvature.data());
  system.apply_jacobian_transposed(q.data(), w.data(), force.data());
  system.report(q.data(), v.data(), vdot.data(), lambda.data(), column.data());
  const long counted = allocations - before;
  return {{"q", placed_q}, {"v", placed_v}, {"balance", balance}, {"residual", residual}, {"linear_balance", linear_balance},
          {"linear_residual", linear_residual}, {"tangent", tangent}, {"phi", phi}, {"rate", rate}, {"curvature", curvature},
          {"force", force}, {"column", column}, {"allocations", counted}};
}

}  // namespace

extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

int main(int, char** argv) {
  const Json task = cutjoint::read_json(argv[1]);
  System system(task.at("model"));
  const cutjoint::SystemDescription& d = system.description();
  const cutjoint::Roads<double> roads(d.roads, task);
  const Array parameters = cutjoint::read_parameters<double>(d.parameters, task);
  const long before = allocations;
  system.load(parameters.data(), roads.list().data());
  const long loading = allocations - before;
  Json results{{"first", d.pattern.first}, {"row", d.pattern.row}, {"symmetric", d.pattern.symmetric}, {"loading", loading},
               {"coordinates", d.coordinates}, {"equations", d.equations}, {"allocated", allocations}, {"states", Json::array()}};
  for (const Json& state : task.at("states")) results["states"].push_back(evaluate(system, state));
  std::cout << results << std::endl;
}
