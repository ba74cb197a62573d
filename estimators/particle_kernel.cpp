#include "estimators/particle_kernel.h"

namespace holdfast {

extern const ParticleKernel kPortableKernel;
#ifdef HOLDFAST_HAS_LIBMVEC
extern const ParticleKernel kAvx2Kernel;
extern const ParticleKernel kAvx512Kernel;
#endif

namespace {

std::vector<const ParticleKernel*> usable_kernels() {
  std::vector<const ParticleKernel*> kernels;
#ifdef HOLDFAST_HAS_LIBMVEC
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    kernels.push_back(&kAvx512Kernel);
  }
  if (has_avx2) kernels.push_back(&kAvx2Kernel);
#endif
  kernels.push_back(&kPortableKernel);
  return kernels;
}

}  // namespace

const std::vector<const ParticleKernel*>& particle_kernels() {
  static const std::vector<const ParticleKernel*> kernels = usable_kernels();
  return kernels;
}

const ParticleKernel* find_particle_kernel(std::string_view name) {
  if (name == "auto") return particle_kernels().front();
  for (const ParticleKernel* kernel : particle_kernels()) {
    if (name == kernel->name) return kernel;
  }
  return nullptr;
}

const char* particle_kernel_name() {
  return particle_kernels().front()->name;
}

}  // namespace holdfast
