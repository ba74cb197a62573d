#include "tools/modbus_process.h"

#include <algorithm>
#include <array>
#include <set>

#include "common/errors.h"

namespace holdfast {
namespace {

// A time-out of a unit that is pulled out is told once, not in each step.
const char* told_as(ModbusAnswer answer) {
  switch (answer) {
    case ModbusAnswer::kInputs:
      return "answers";
    case ModbusAnswer::kSilent:
      return "does not answer";
    case ModbusAnswer::kBroken:
      return "cannot be understood";
    case ModbusAnswer::kException:
      return "refuses";
    case ModbusAnswer::kLineGone:
      return "cannot be asked, the line is gone";
  }
  return "";
}

const char* counter_of(ModbusAnswer answer) {
  switch (answer) {
    case ModbusAnswer::kInputs:
      return "answers";
    case ModbusAnswer::kSilent:
      return "silent";
    case ModbusAnswer::kBroken:
      return "broken_answers";
    case ModbusAnswer::kException:
      return "exceptions";
    case ModbusAnswer::kLineGone:
      return "line_gone";
  }
  return "";
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
      client_(ModbusUrl::parse(line), experiment.layout.sensors.modbus_timeout_s),
      units_(modbus_units(sensors_with_units(experiment))),
      last_answers_(units_.size(), ModbusAnswer::kInputs) {}

bool ModbusGateway::take_step() {
  status_.set_state(ProcessState::kRunning);
  frames_.clear();
  for (std::size_t i = 0; i < units_.size(); ++i) {
    const ModbusAnswer answer = ask(units_[i]);
    if (answer != last_answers_[i]) note(units_[i].unit(), answer);
    last_answers_[i] = answer;
    units_[i].tell(frames_);
  }
  if (experiment_.assembler.closed_by_tick) frames_.push_back(codec_.encode_tick(step_));
  status_.counter("frames_sent") += static_cast<std::int64_t>(bus_.write(frames_));
  status_.counter("bus_write_dropped") = bus_.counters().write_dropped;
  status_.set_step(step_);
  return ++step_ <= experiment_.num_steps;
}

ModbusAnswer ModbusGateway::ask(ModbusUnit& unit) {
  ModbusAnswer worst = ModbusAnswer::kInputs;
  for (const ModbusRequest& request : unit.requests()) {
    ModbusAnswer answer = worst;
    // Who did not answer once in this step costs no second time-out.
    if (worst != ModbusAnswer::kSilent && worst != ModbusAnswer::kLineGone) {
      inputs_.resize(request.places.size());
      answer = client_.read_inputs(unit.unit(), request.first_input, inputs_);
      ++status_.counter("requests");
      ++status_.counter(counter_of(answer));
    }
    unit.take(request, answer, inputs_);
    if (answer != ModbusAnswer::kInputs) worst = answer;
  }
  return worst;
}

void ModbusGateway::note(int unit, ModbusAnswer answer) {
  const std::string why = answer == ModbusAnswer::kInputs ? "" : " (" + client_.problem() + ")";
  status_.remark("unit " + std::to_string(unit) + " " + told_as(answer) + why + ", step " +
                 std::to_string(step_));
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
  const std::optional<int> asked = server_.take_request();
  if (!asked) return;
  ++status_.counter("requests");
  asked_ = asked;
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
