#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <utility>

namespace holdfast {

/// Every particle array is padded to a multiple of this, so that no kernel needs a remainder loop.
inline constexpr std::size_t kParticlePadding = 8;

constexpr std::size_t padded_size(std::size_t size) {
  return (size + kParticlePadding - 1) / kParticlePadding * kParticlePadding;
}

/// An array of doubles on a cache line boundary, zero at first, padded by padded_size().
class AlignedArray {
 public:
  AlignedArray() = default;
  explicit AlignedArray(std::size_t size) : size_(padded_size(size)) {
    data_ = static_cast<double*>(::operator new(size_ * sizeof(double), kAlignment));
    for (std::size_t i = 0; i < size_; ++i) data_[i] = 0.0;
  }
  AlignedArray(AlignedArray&& other) noexcept { swap(other); }
  AlignedArray& operator=(AlignedArray&& other) noexcept {
    swap(other);
    return *this;
  }
  AlignedArray(const AlignedArray&) = delete;
  AlignedArray& operator=(const AlignedArray&) = delete;
  ~AlignedArray() {
    if (data_ != nullptr) ::operator delete(data_, kAlignment);
  }

  void swap(AlignedArray& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }
  double* data() { return data_; }
  const double* data() const { return data_; }
  double& operator[](std::size_t i) { return data_[i]; }
  double operator[](std::size_t i) const { return data_[i]; }
  std::size_t padded() const { return size_; }

 private:
  static constexpr std::align_val_t kAlignment{64};

  double* data_ = nullptr;
  std::size_t size_ = 0;
};

/// M particles of four numbers each, one array per component: state [x m, vx m/s, y m, vy m/s], or
/// one standard normal per component. Entries from size on are padding: finite, without meaning.
struct ParticleSet {
  explicit ParticleSet(std::size_t num_particles)
      : size(num_particles),
        component{AlignedArray(num_particles), AlignedArray(num_particles),
                  AlignedArray(num_particles), AlignedArray(num_particles)} {}

  void swap(ParticleSet& other) noexcept {
    std::swap(size, other.size);
    for (std::size_t c = 0; c < 4; ++c) component[c].swap(other.component[c]);
  }
  const double* x() const { return component[0].data(); }
  const double* y() const { return component[2].data(); }
  std::size_t padded() const { return component[0].padded(); }

  std::size_t size;
  AlignedArray component[4];
};

}  // namespace holdfast
