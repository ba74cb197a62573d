// Counts what asks malloc itself, as Eigen's matrices do; for a program linked with
// -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc.
#include <cstddef>

#include "tests/support/allocation_count.h"

extern "C" {

void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* memory, std::size_t size);

void* __wrap_malloc(std::size_t size) {
  holdfast::testing::count_allocation();
  return __real_malloc(size);
}
void* __wrap_calloc(std::size_t count, std::size_t size) {
  holdfast::testing::count_allocation();
  return __real_calloc(count, size);
}
void* __wrap_realloc(void* memory, std::size_t size) {
  holdfast::testing::count_allocation();
  return __real_realloc(memory, size);
}
}
