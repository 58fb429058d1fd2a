// The part of the runtime that generated functions read, beside lanes, roads and inputs.  It includes nothing, since each of their files reads it.
#pragma once

// A generated function is compiled as if it had a file of its own.
#if defined(__GNUC__) && !defined(__clang__)
#define CUTJOINT_APART [[gnu::noipa]]
#else
#define CUTJOINT_APART [[gnu::noinline]]
#endif

// A part of a long function, up to the next, is compiled as if it stood alone: the time that GCC takes grows with the square of a part's length.
#if defined(__GNUC__) && !defined(__clang__)
#define CUTJOINT_PART(label)  \
  asm goto("" : : : : label); \
  label:
#else
#define CUTJOINT_PART(label)
#endif

namespace cutjoint {

template <class Real>
class Road;

/// Parameters of the cut joints: penalty alpha, damping ratio xi, frequency omega in 1/s (Cuadrado et al. 2000, eq. 39).  The proximal closure
/// has a penalty for each cut joint, which `load` reads, and nothing else.
template <class Real>
struct Stabilisation {
  Real penalty{1};
  Real damping_ratio{1};
  Real frequency{10};
  const Real* penalties = nullptr;
};

/// Weights of the terms of a tangent, A = M + damping C + stiffness K with K = -dQ/dq, C = -dQ/dqd:
///
/// - augmented: A + constraint Phi_q^T Phi_q, the symmetric part of C and K,
/// - classical: [A, constraint Phi_q^T; constraint Phi_q, 0].
///
/// In relative coordinates the tangent is whole, and `ball_tangents` has for each ball the 3x3 matrix of that function (retraction.hpp), by rows.
template <class Real>
struct Weights {
  Real damping;
  Real stiffness;
  Real constraint;
  const Real* ball_tangents = nullptr;
};

/// condition ? yes : no, both evaluated.
template <class Real>
constexpr Real where(bool condition, Real yes, Real no) {
  return condition ? yes : no;
}

}  // namespace cutjoint
