#pragma once

#include <cstddef>
#include <vector>

#include "estimators/rts_smoother.h"
#include "estimators/sized_model.h"
#include "estimators/small_factor.h"

namespace holdfast {

/// Expectation propagation for a linear model: each step has a Gaussian site on s = H x, which
/// stands for its reading and is fitted to the reading's true density in the light of the past and
/// the future. The first pass is the collapsing filter with its Rauch-Tung-Striebel smoother.
///
/// Symbols: Lambda, eta precision and shift of a site; B, a covariance and mean of s.
template <int N, int L>
class SiteSmoother {
 public:
  /// tilt(i, cavity, tilted): moments of s under the cavity times the likelihood of the i-th
  /// reading; false where it teaches nothing. step_at(i): predicted belief of the first step, to
  /// begin from.
  /// begin_pass() is called before each pass.
  template <class StepAt, class BeginPass, class Tilt>
  void smooth(SizedModel<N, L>& model, std::size_t count, int num_passes, const StepAt& step_at,
              const BeginPass& begin_pass, const Tilt& tilt, std::vector<Belief<N>>& smoothed) {
    sites_.resize(count);
    for (Site& site : sites_) site.is_set = false;
    track_.resize(count);
    for (int pass = 0; pass < num_passes; ++pass) {
      begin_pass();
      for (std::size_t k = 0; k < count; ++k) {
        SmoothingStep<N>& step = track_[k];
        if (k == 0) {
          step.predicted = step_at(0).predicted;
        } else {
          model.predict(track_[k - 1].filtered, step.cross, step.predicted);
        }
        model.observe(step.predicted, observation_);
        prediction_ = {observation_.h, observation_.Phh};
        if (factor_.factorise(prediction_.covariance)) {
          if (pass == 0) {
            refit(k, prediction_, tilt);
          } else if (find_cavity(k, model, smoothed[k])) {
            refit(k, cavity_, tilt);
          }
        }
        apply(sites_[k], step.predicted, step.filtered);
      }
      smooth_interval<N>(
          count, [this](std::size_t k) -> const auto& { return track_[k]; }, smoothed);
    }
  }

 private:
  struct Site {
    bool is_set;
    Small<L, L> precision;  // Lambda
    Small<L> shift;         // eta
  };

  static bool invert(const Small<L, L>& matrix, Small<L, L>& inverse) {
    SmallFactor<L> factor;
    if (!factor.factorise(matrix)) return false;
    factor.invert(inverse);
    return true;
  }

  // The smoothed s with the site divided out; false when nothing proper is left.
  bool find_cavity(std::size_t k, SizedModel<N, L>& model, const Belief<N>& smoothed) {
    model.observe(smoothed, smoothed_observation_);
    const Site& site = sites_[k];
    if (!site.is_set) {
      cavity_ = {smoothed_observation_.h, smoothed_observation_.Phh};
      return true;
    }
    Small<L, L> precision;
    if (!invert(smoothed_observation_.Phh, precision)) return false;
    Small<L> shift = precision * smoothed_observation_.h;
    shift -= site.shift;
    precision -= site.precision;
    symmetrise_small(precision);
    if (!invert(precision, cavity_.covariance)) return false;
    cavity_.mean.noalias() = cavity_.covariance * shift;
    return true;
  }

  // A new site from the tilted moments, kept only if the filter stays proper with it.
  template <class Tilt>
  void refit(std::size_t k, const Belief<L>& cavity, const Tilt& tilt) {
    Small<L, L> before, after;
    if (!tilt(k, cavity, tilted_) || !invert(cavity.covariance, before) ||
        !invert(tilted_.covariance, after)) {
      return;
    }
    Site site;
    site.is_set = true;
    site.precision = after - before;
    site.shift = after * tilted_.mean;
    site.shift -= before * cavity.mean;
    symmetrise_small(site.precision);
    if (find_corrected(site)) sites_[k] = site;
  }

  // s by prediction and site; false when B^-1 + Lambda is not positive definite.
  bool find_corrected(const Site& site) {
    Small<L, L> precision;
    if (!invert(prediction_.covariance, precision)) return false;
    Small<L> shift = precision * prediction_.mean;
    shift += site.shift;
    precision += site.precision;
    if (!invert(precision, corrected_.covariance)) return false;
    corrected_.mean.noalias() = corrected_.covariance * shift;
    return true;
  }

  // x learns what s learnt: gain Pxh B^-1.
  void apply(const Site& site, const Belief<N>& predicted, Belief<N>& filtered) {
    filtered = predicted;
    if (!site.is_set || !factor_.factorise(prediction_.covariance) || !find_corrected(site)) return;
    Small<N, L> gain = observation_.Pxh;
    factor_.solve_right(gain);
    const Small<L> shift = corrected_.mean - prediction_.mean;
    filtered.mean.noalias() += gain * shift;
    const Small<L, L> change = corrected_.covariance - prediction_.covariance;
    Small<N, L> gained;
    gained.noalias() = gain * change;
    filtered.covariance.noalias() += gained * gain.transpose();
    symmetrise_small(filtered.covariance);
  }

  std::vector<Site> sites_;
  std::vector<SmoothingStep<N>> track_;
  Observation<N, L> observation_, smoothed_observation_;
  Belief<L> prediction_, cavity_, tilted_, corrected_;
  SmallFactor<L> factor_;
};

}  // namespace holdfast
