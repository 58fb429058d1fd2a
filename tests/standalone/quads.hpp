// The code of a folder for numbers of 113 bits.  MODEL and TITLE are the name of the model, in capitals too, SOURCE is its file, FUNCTIONS one with
// those that its user supplies, for these numbers.
#pragma once

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define OF(name) JOIN(MODEL, _##name)
#define COUNT(name) JOIN(TITLE, _##name)

#define cutjoint quads  // the folder has a namespace of that name in its own
#include "cutjoint/quad.hpp"
#undef cutjoint

using quads::Quad;

#include SOURCE

namespace OF(code)::cutjoint {  // the functions of the model
#include FUNCTIONS
}

namespace core = OF(code)::cutjoint;
namespace code = OF(code);

template <class Subject>
struct InQuad;
template <template <class> class Subject>
struct InQuad<Subject<double>> {
  using type = Subject<Quad>;
};
