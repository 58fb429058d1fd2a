// The simulator of a model that is interpreted at run time: `generic RUN.json`, where the run file has the model's description, or names a file
// with it.
#include "cutjoint/core/stepping/fixed_point_steps.hpp"
#include "cutjoint/examine.hpp"
#include "cutjoint/generic/mechanism.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"
#include "natural.hpp"

namespace {

using cutjoint::Json;
using Mechanism = cutjoint::generic::GenericMechanism<double>;

static_assert(cutjoint::Mechanism<Mechanism>);

/// The mechanism in which a run with natural coordinates starts, behind virtual functions: compiled here alone.
class Start final : public cutjoint::AnyMechanism<double> {
 public:
  explicit Start(const Json& model) : mechanism_(model) {}

  const cutjoint::Description& description() const override { return mechanism_.description(); }
  void load(const double* parameters, const cutjoint::Stabilisation<double>& stabilisation, const cutjoint::Road<double>* roads) override {
    mechanism_.load(parameters, stabilisation, roads);
  }
  void begin_step(double t, double motion) override { mechanism_.begin_step(t, motion); }
  void drive_by(const cutjoint::InputSource<double>& source) override { mechanism_.drive_by(source); }
  void evaluate(const double* q, const double* v, const double* lambda, double* vdot, double* correction) const override {
    mechanism_.evaluate(q, v, lambda, vdot, correction);
  }
  void constraint_residual(const double* q, const double* v, double* residual, double* rate) const override {
    mechanism_.constraint_residual(q, v, residual, rate);
  }
  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const override {
    mechanism_.report(q, v, vdot, lambda, column);
  }
  void energy(const double* q, const double* v, const double* vdot, const double* lambda, double* energy) const override {
    mechanism_.energy(q, v, vdot, lambda, energy);
  }
  void project(const double* q, const double* gap, double* dz) const override { mechanism_.project(q, gap, dz); }

 private:
  mutable Mechanism mechanism_;  ///< what it computes on the way stays in it
};

const cutjoint::Abilities abilities{.integrators = &cutjoint::IntegratorRow::generic};

}  // namespace

int main(int argc, char** argv) {
  return cutjoint::run_program(argc, argv, "generic", [](const Json& file) {
    const Json& place = file.at("model");
    const Json model = place.is_string() ? cutjoint::read_json(place) : place;
    if (model.contains("method")) {
      Start start(model.at("start"));
      return run_natural(model, start, file);
    }
    Mechanism start(model), mechanism(model);
    if (cutjoint::examine::is_asked(file)) return cutjoint::examine::perform(file, start, mechanism, abilities.integrators);
    const cutjoint::RunSettings settings = cutjoint::read_settings(file, abilities);
    cutjoint::Simulated<cutjoint::FixedPointSteps<Mechanism>> method(mechanism, settings, file);
    return cutjoint::Run(start, method, settings, file).perform();
  });
}
