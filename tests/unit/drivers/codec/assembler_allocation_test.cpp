#include <cstdlib>
#include <new>

#include "drivers/measurement_assembler.h"
#include "drivers/radio_channel.h"
#include "tests/support/catch.h"
#include "tests/unit/drivers/codec/sensors_layout.h"

namespace {

std::size_t num_allocations = 0;

void* counted(std::size_t size) noexcept {
  ++num_allocations;
  return std::malloc(size == 0 ? 1 : size);
}

void* counted_or_throw(std::size_t size) {
  if (void* memory = counted(size)) return memory;
  throw std::bad_alloc();
}

}  // namespace

// Every form, so that a sanitizer's own never meets ours.
void* operator new(std::size_t size) {
  return counted_or_throw(size);
}
void* operator new[](std::size_t size) {
  return counted_or_throw(size);
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return counted(size);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return counted(size);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}

namespace holdfast {
namespace {

TEST_CASE("encoding, decoding, assembling and the radio allocate nothing once warm") {
  const FrameCodec codec(small_layout());
  MeasurementAssembler assembler(codec, {});
  RadioChannel radio(2.0, 0.5, 1, 0);
  MeasurementSet heard;
  double sum = 0.0;
  const auto run_step = [&](std::int64_t step) {
    const double bit = 1.0;
    for (int source = 0; source < 3; ++source) {
      for (int copy = 0; copy < 3; ++copy)
        assembler.on_frame(codec.encode(source, {&bit, 1}, step));
      assembler.on_frame(codec.encode(source, {&bit, 1}, step + 1));  // refused
    }
    heard = *assembler.on_frame(codec.encode_tick(step));
    radio.apply(heard);
    sum += heard.values.front();
  };
  run_step(1);
  run_step(2);  // the second of the two sets
  run_step(3);
  const std::size_t before = num_allocations;
  for (std::int64_t step = 4; step < 200; ++step) run_step(step);
  CHECK(num_allocations == before);
  CHECK(sum != 0.0);
  // Negative control: the counter sees allocations.
  const std::vector<double> some(10);
  CHECK(num_allocations > before);
}

}  // namespace
}  // namespace holdfast
