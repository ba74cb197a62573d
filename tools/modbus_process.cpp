#include "tools/modbus_process.h"

#include <algorithm>
#include <array>
#include <set>

#include "common/errors.h"

namespace holdfast {
namespace {

struct AnswerWords {
  const char *counter, *told;
};

AnswerWords words_of(ModbusAnswer answer) {
  switch (answer) {
    case ModbusAnswer::kInputs:
      return {"answers", "answers"};
    case ModbusAnswer::kSilent:
      return {"silent", "does not answer"};
    case ModbusAnswer::kBroken:
      return {"broken_answers", "cannot be understood"};
    case ModbusAnswer::kException:
      return {"exceptions", "refuses"};
    case ModbusAnswer::kLineGone:
      return {"line_gone", "cannot be asked, the line is gone"};
  }
  return {"unknown_answers", "answers in an unknown way"};
}

const BinarySensors& sensors_with_units(const Experiment& experiment) {
  if (!experiment.layout.sensors.have_units())
    throw UsageError("the scenario has no sensor on Modbus (network.sensors: modbus)");
  return experiment.layout.sensors;
}

const BinarySensors& sensors_with_unit(const Experiment& experiment, int unit) {
  std::set<int> numbers;
  for (const ModbusUnit& known : modbus_units(sensors_with_units(experiment)))
    numbers.insert(known.unit());
  if (numbers.contains(unit)) return experiment.layout.sensors;
  std::string known;
  for (const int number : numbers) known += (known.empty() ? "" : ", ") + std::to_string(number);
  throw UsageError("the scenario has no sensor on unit " + std::to_string(unit) +
                   "; its units are: " + known);
}

}  // namespace

ModbusGateway::ModbusGateway(const Experiment& experiment, const std::string& line, CanBus& bus,
                             LcmLink& link)
    : experiment_(experiment),
      bus_(bus),
      status_(link, "modbus"),
      codec_(experiment.layout),
      gap_s_(ModbusUrl::parse(line).gap_s()),
      client_(ModbusUrl::parse(line), sensors_with_units(experiment).modbus_timeout_s),
      units_(modbus_units(experiment.layout.sensors)),
      told_(units_.size(), ModbusAnswer::kInputs) {
  const double longest_s =
      static_cast<double>(units_.size()) * experiment.layout.sensors.modbus_timeout_s;
  if (longest_s > experiment.period_s)
    status_.remark("units that are silent make steps late: " + std::to_string(units_.size()) +
                   " times modbus_timeout_s is longer than period_s");
}

bool ModbusGateway::ask_next() {
  status_.set_state(ProcessState::kRunning);
  ModbusUnit& unit = units_[unit_];
  const ModbusRequest& request = unit.requests()[request_];
  // Who did not answer once in this step costs no second time-out.
  const bool is_away =
      last_failure_ == ModbusAnswer::kSilent || last_failure_ == ModbusAnswer::kLineGone;
  const ModbusAnswer answer = is_away ? last_failure_ : ask(unit, request);
  unit.take(request, answer, inputs_);
  if (answer != ModbusAnswer::kInputs) last_failure_ = answer;
  if (++request_ < unit.requests().size()) return false;
  end_unit();
  if (unit_ < units_.size()) return false;
  end_step();
  return true;
}

ModbusAnswer ModbusGateway::ask(const ModbusUnit& unit, const ModbusRequest& request) {
  inputs_.resize(request.places.size());
  const ModbusAnswer answer = client_.read_inputs(unit.unit(), request.first_input, inputs_);
  if (answer == ModbusAnswer::kInputs) ++num_answers_;
  ++status_.counter("requests");
  ++status_.counter(words_of(answer).counter);
  return answer;
}

void ModbusGateway::end_unit() {
  // A unit that is pulled out is told of once, not in each step.
  if (last_failure_ != told_[unit_]) {
    const bool has_failed = last_failure_ != ModbusAnswer::kInputs;
    status_.remark(
        "unit " + std::to_string(units_[unit_].unit()) + " " + words_of(last_failure_).told +
        (has_failed ? " (" + client_.problem() + ")" : "") + ", step " + std::to_string(step_));
  }
  told_[unit_] = last_failure_;
  last_failure_ = ModbusAnswer::kInputs;
  request_ = 0;
  ++unit_;
}

void ModbusGateway::end_step() {
  frames_.clear();
  for (const ModbusUnit& unit : units_) unit.tell(frames_);
  if (experiment_.assembler.closed_by_tick) frames_.push_back(codec_.encode_tick(step_));
  status_.counter("frames_sent") += static_cast<std::int64_t>(bus_.write(frames_));
  status_.counter("bus_write_dropped") = bus_.counters().write_dropped;
  status_.set_step(step_);
  ++step_;
  unit_ = 0;
}

std::string ModbusGateway::fault() const {
  if (num_answers_ == 0) return "no unit ever answered";
  const std::int64_t lost = bus_.counters().write_dropped;
  return lost > 0 ? std::to_string(lost) + " frames were lost" : "";
}

ModbusUnitProcess::ModbusUnitProcess(const Experiment& experiment, const std::string& line,
                                     int unit, bool is_in_step, CanBus& bus, LcmLink& link)
    : bus_(bus),
      status_(link, "modbus_unit_" + std::to_string(unit)),
      codec_(experiment.layout),
      twin_(sensors_with_unit(experiment, unit), unit, is_in_step),
      server_(ModbusUrl::parse(line), unit) {}

void ModbusUnitProcess::on_bus() {
  std::array<CanFrame, 64> batch;
  for (std::size_t count = batch.size(); count == batch.size();) {
    count = bus_.read(batch);
    for (std::size_t i = 0; i < count; ++i) {
      if (codec_.is_tick(batch[i])) {
        twin_.end_step();
      } else {
        twin_.on_frame(batch[i]);
      }
    }
  }
  if (asked_) reply();
}

void ModbusUnitProcess::on_line() {
  // A request that comes while another waits takes its place: there is one buffer.
  asked_ = server_.take_request();
  if (!asked_) return;
  ++status_.counter("requests");
  reply();
}

void ModbusUnitProcess::reply() {
  const ModbusTwin::Reply reply = twin_.on_request(*asked_);
  if (reply == ModbusTwin::Reply::kNotYet) return;
  asked_.reset();
  if (reply == ModbusTwin::Reply::kSilent) return;
  server_.answer(twin_.first_input(), twin_.inputs());
  ++status_.counter("answers");
}

void ModbusUnitProcess::publish_status() {
  status_.counter("steps_forgotten") = twin_.num_forgotten();
  status_.counter("bus_kernel_dropped") = bus_.counters().kernel_dropped;
  status_.publish();
}

}  // namespace holdfast
