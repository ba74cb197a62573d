#pragma once

#include "common/models/system_model.h"

namespace holdfast {

/// Whether two modes, of any two topologies, can be taken for each other for ever: true when equal
/// readings of both, whatever is attacked in each, make the difference of their states die out. By
/// the largest subspace of joint states [x_1; x_2] that can give equal readings for ever; what of
/// it moves x_1 - x_2 must be out of the attackers' reach and stable. In one topology this is the
/// strong detectability of the channels of both (paper 004, section IV-B). Known inputs are taken
/// to be zero. Precondition: linear models of as many states and readings.
bool is_state_common(const SystemModel& one, const SystemModel& other);

}  // namespace holdfast
