// Files that a caller has opened for this program.
#pragma once

#include <stdio.h>
#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#endif

namespace cutjoint {

/// A stream of an open file that this program has inherited, by its number: a descriptor, on Windows a handle.  Null, with errno, if there is none.
inline FILE* open_for_child(long long number, const char* mode) {
#ifdef _WIN32
  return fdopen(_open_osfhandle(static_cast<intptr_t>(number), _O_BINARY), mode);
#else
  return fdopen(static_cast<int>(number), mode);
#endif
}

}  // namespace cutjoint
