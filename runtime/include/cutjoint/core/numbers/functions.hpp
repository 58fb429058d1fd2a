// Functions of one number x with value y: `make regenerate` writes this file from the rows of compiler/cutjoint/ops.py.
#pragma once

/// X(name, derivative) of those that namespace std has by the same name.
#define CUTJOINT_FUNCTIONS(X) \
  X(sqrt, (0.5 / y)) \
  X(sin, cos(x)) \
  X(cos, -sin(x)) \
  X(tan, (1.0 + y * y)) \
  X(asin, (1.0 / sqrt(1.0 - x * x))) \
  X(acos, -(1.0 / sqrt(1.0 - x * x))) \
  X(atan, (1.0 / (1.0 + x * x))) \
  X(sinh, cosh(x)) \
  X(cosh, sinh(x)) \
  X(tanh, (1.0 - y * y)) \
  X(exp, y) \
  X(log, (1.0 / x))
