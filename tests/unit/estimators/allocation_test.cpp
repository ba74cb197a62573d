// In a program of its own: it replaces operator new to count.

#include <atomic>
#include <cstdlib>
#include <new>

#include "estimators/secure_particle_filter.h"
#include "tests/unit/estimators/golden_binary_pf.h"

namespace {

std::atomic<long> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  void* memory = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) {
  return counted(size, alignof(std::max_align_t));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return counted(size, alignof(std::max_align_t));
}
void operator delete(void* memory, const std::nothrow_t&) noexcept {
  std::free(memory);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}

using namespace holdfast;
using Options = SecureParticleFilterOptions;

TEST_CASE("a step allocates nothing once the filter has seen the largest set") {
  const BinaryTargetModel model = testing::grid_model(true);
  const Eigen::VectorXd no_input;
  std::vector<Options> variants(5);
  variants[1].likelihood = Options::Likelihood::kTable;
  variants[2].resampling = Options::Resampling::kMultinomial;
  variants[2].resample_below = 0.5;
  variants[3].proposal = Options::Proposal::kAuxiliary;
  variants[4].duplicates = DuplicateRule::kProduct;
  for (const bool is_neglecting : {false, true}) {
    for (const Options& options : variants) {
      SecureParticleFilter filter(
          model, is_neglecting ? BinaryTargetModel::Attack{} : testing::table_attack(), options, 1,
          0, "pf");
      MeasurementSet largest, smaller, empty;
      for (int s = 0; s < 16; ++s) {
        testing::add_packet(largest, s, 0.03 * s);
        testing::add_packet(smaller, s, 0.5 - 0.03 * s);
      }
      testing::add_packet(largest, 3, 0.5);
      testing::add_packet(largest, 99, 0.5);
      filter.step(1, largest, no_input);
      const long before = allocations;
      for (std::int64_t k = 2; k < 40; ++k) {
        filter.step(k, k % 7 == 0 ? empty : k % 2 == 0 ? largest : smaller, no_input);
      }
      CHECK(allocations == before);
    }
  }
  const long before = allocations;
  const Options one;
  const SecureParticleFilter counted_one(model, {}, one, 1, 0, "pf");
  CHECK(allocations > before);  // negative control: the counter counts
}
