#pragma once

#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

namespace holdfast {

/// Number of sets of k things out of n; 0 where there are none.
inline double binomial(int n, int k) {
  if (k < 0 || k > n) return 0.0;
  return std::round(
      std::exp(std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0)));
}

/// Calls visit(subset) for every set of `size` of the items, each in the items' order, in
/// lexicographic order of their places.
template <class Visit>
void for_each_subset(const std::vector<int>& items, std::size_t size, const Visit& visit) {
  if (size > items.size()) return;
  std::vector<std::size_t> places(size);
  std::iota(places.begin(), places.end(), std::size_t{0});
  for (;;) {
    std::vector<int> subset;
    for (const std::size_t place : places) subset.push_back(items[place]);
    visit(subset);
    std::size_t i = size;
    while (i > 0 && places[i - 1] == items.size() - size + i - 1) --i;
    if (i == 0) return;
    ++places[i - 1];
    for (; i < size; ++i) places[i] = places[i - 1] + 1;
  }
}

}  // namespace holdfast
