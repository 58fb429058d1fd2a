#include "pinocchio_dynamics.hpp"

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/algorithm/loop-constrained-aba.hpp>

namespace exported {

namespace pin = pinocchio;
using Eigen::VectorXd;

void prepare(Dynamics dynamics, const pin::Model& model, pin::Data& data, const Contacts& contacts) {
  if (dynamics == Dynamics::articulated) pin::computeJointMinimalOrdering(model, data, contacts.models);
  if (dynamics == Dynamics::factorised) pin::initConstraintDynamics(model, data, contacts.models, contacts.data);
}

const VectorXd& accelerations(Dynamics dynamics, const pin::Model& model, pin::Data& data, const VectorXd& q, const VectorXd& v,
                              const VectorXd& tau, Contacts& contacts, pin::ProximalSettings& settings) {
  if (dynamics == Dynamics::articulated) return pin::lcaba(model, data, q, v, tau, contacts.models, contacts.data, settings);
  if (dynamics == Dynamics::factorised) return pin::constraintDynamics(model, data, q, v, tau, contacts.models, contacts.data, settings);
  return pin::aba(model, data, q, v, tau);
}

}  // namespace exported
