/* Counts calls that take memory, for LD_PRELOAD: malloc itself is interposed, since not all code goes through operator new.
   The count goes to the file that $ALLOCATIONS names, when the program ends. */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

extern void* __libc_malloc(size_t size);
extern void* __libc_calloc(size_t number, size_t size);
extern void* __libc_realloc(void* place, size_t size);
extern void* __libc_memalign(size_t alignment, size_t size);

static long count = 0;

void* malloc(size_t size) {
  ++count;
  return __libc_malloc(size);
}

void* calloc(size_t number, size_t size) {
  ++count;
  return __libc_calloc(number, size);
}

void* realloc(void* place, size_t size) {
  ++count;
  return __libc_realloc(place, size);
}

void* aligned_alloc(size_t alignment, size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** place, size_t alignment, size_t size) {
  ++count;
  *place = __libc_memalign(alignment, size);
  return *place ? 0 : ENOMEM;
}

__attribute__((destructor)) static void tell(void) {
  const long counted = count;
  FILE* file = fopen(getenv("ALLOCATIONS"), "w");
  fprintf(file, "%ld\n", counted);
  fclose(file);
}
