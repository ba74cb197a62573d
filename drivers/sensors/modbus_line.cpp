#include "drivers/sensors/modbus_line.h"

#include <modbus/modbus.h>
#include <sys/file.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>

#include "common/errors.h"
#include "drivers/serial_url.h"

namespace holdfast {
namespace {

constexpr const char* kLineForm = "expected DEVICE[@BAUD][?parity=even|odd|none][&stop=1|2]";
// What libmodbus sets; it takes others for 9600.
constexpr std::array<int, 16> kLineBauds = {300,    600,    1200,   2400,   4800,   9600,
                                            19200,  38400,  57600,  115200, 230400, 460800,
                                            500000, 576000, 921600, 1000000};
constexpr int kFunctionOffset = 1, kReadInputs = 2;
// How long a line is idle between messages: 3.5 characters of 11 bits, and for fast lines what the
// standard sets.
constexpr double kGapCharacters = 3.5, kCharacterBits = 11.0, kGapLeast_s = 0.00175;

int address_in(std::span<const std::uint8_t> request) {
  return request[2] << 8 | request[3];
}

}  // namespace

/// Owns a libmodbus context for a serial line.
class ModbusContext {
 public:
  explicit ModbusContext(const ModbusUrl& url)
      : context_(modbus_new_rtu(url.device.c_str(), url.baud, url.parity, 8, url.stop_bits)) {
    if (!context_) throw JobError(url.device + ": " + modbus_strerror(errno));
  }

  ModbusContext(const ModbusContext&) = delete;
  ModbusContext& operator=(const ModbusContext&) = delete;
  ~ModbusContext() { close(); }

  modbus_t* get() const { return context_.get(); }
  const std::string& problem() const { return problem_; }
  void set_problem(int error) { problem_ = modbus_strerror(error); }

  bool open() {
    if (is_open_) return true;
    is_open_ = modbus_connect(context_.get()) == 0;
    if (!is_open_) {
      set_problem(errno);
    } else if (flock(modbus_get_socket(context_.get()), LOCK_EX | LOCK_NB) != 0) {
      // Two that ask on one line take each other's answers.
      problem_ = "another program has locked it";
      close();
    }
    return is_open_;
  }
  void require_open(const std::string& device) {
    if (!open()) throw JobError(device + ": cannot be opened: " + problem_);
  }
  void close() {
    if (is_open_) modbus_close(context_.get());
    is_open_ = false;
  }

 private:
  struct Free {
    void operator()(modbus_t* context) const { modbus_free(context); }
  };
  std::unique_ptr<modbus_t, Free> context_;
  bool is_open_ = false;
  std::string problem_;
};

ModbusUrl ModbusUrl::parse(const std::string& url) {
  const SerialUrl line = SerialUrl::parse(url, url, kLineForm);
  ModbusUrl parsed;
  parsed.device = line.device;
  parsed.baud = line.baud.value_or(parsed.baud);
  if (std::ranges::find(kLineBauds, parsed.baud) == kLineBauds.end()) {
    std::string known;
    for (const int baud : kLineBauds) known += (known.empty() ? "" : ", ") + std::to_string(baud);
    throw UsageError(url + ": a serial line of " + std::to_string(parsed.baud) +
                     " is none of: " + known);
  }
  for (const auto& [key, value] : line.options) {
    if (key == "parity" && (value == "even" || value == "odd" || value == "none")) {
      parsed.parity = value == "even" ? 'E' : value == "odd" ? 'O' : 'N';
    } else if (key == "stop" && (value == "1" || value == "2")) {
      parsed.stop_bits = value == "1" ? 1 : 2;
    } else {
      throw UsageError(url + ": '" + key + "=" + value + "' is not understood; " + kLineForm);
    }
  }
  return parsed;
}

double ModbusUrl::gap_s() const {
  return std::max(kGapLeast_s, kGapCharacters * kCharacterBits / baud);
}

ModbusClient::ModbusClient(const ModbusUrl& url, double response_timeout_s)
    : context_(std::make_unique<ModbusContext>(url)) {
  const double whole_s = std::floor(response_timeout_s);
  modbus_set_response_timeout(context_->get(), static_cast<std::uint32_t>(whole_s),
                              static_cast<std::uint32_t>((response_timeout_s - whole_s) * 1e6));
  // None for single bytes: else each one that comes would give the unit its time anew.
  modbus_set_byte_timeout(context_->get(), 0, 0);
  context_->require_open(url.device);
}

ModbusClient::~ModbusClient() = default;

const std::string& ModbusClient::problem() const {
  return context_->problem();
}

ModbusAnswer ModbusClient::read_inputs(int unit, int first_input, std::span<std::uint8_t> inputs) {
  if (!context_->open()) return ModbusAnswer::kLineGone;
  // An answer does not say what was asked: one that came too late, or twice, would be taken for the
  // next one, and so on for ever.
  modbus_flush(context_->get());
  std::array<std::uint8_t, MODBUS_MAX_READ_BITS> bits{};
  modbus_set_slave(context_->get(), unit);
  const int count = static_cast<int>(inputs.size());
  const int got = modbus_read_input_bits(context_->get(), first_input, count, bits.data());
  if (got == count) {
    std::copy_n(bits.begin(), inputs.size(), inputs.begin());
    return ModbusAnswer::kInputs;
  }
  const int error = got < 0 ? errno : EMBBADDATA;
  context_->set_problem(error);
  if (error == ETIMEDOUT || error == EINTR) return ModbusAnswer::kSilent;
  if (error >= EMBBADCRC) return ModbusAnswer::kBroken;
  if (error >= MODBUS_ENOBASE) return ModbusAnswer::kException;
  context_->close();
  return ModbusAnswer::kLineGone;
}

ModbusServer::ModbusServer(const ModbusUrl& url, int unit)
    : context_(std::make_unique<ModbusContext>(url)),
      unit_(unit),
      request_(MODBUS_RTU_MAX_ADU_LENGTH) {
  modbus_set_slave(context_->get(), unit);
  context_->require_open(url.device);
}

ModbusServer::~ModbusServer() = default;

int ModbusServer::file_descriptor() const {
  return modbus_get_socket(context_->get());
}

std::optional<int> ModbusServer::take_request() {
  request_length_ = modbus_receive(context_->get(), request_.data());
  if (request_length_ < 0) {
    const bool is_noise = errno == ETIMEDOUT || errno == EINTR || errno >= MODBUS_ENOBASE;
    if (!is_noise) {
      context_->set_problem(errno);
      throw JobError("the line is gone: " + context_->problem());
    }
    modbus_flush(context_->get());
  }
  if (request_length_ <= 0 || request_[0] != unit_) return std::nullopt;
  if (request_[kFunctionOffset] == kReadInputs) return address_in(request_);
  modbus_reply_exception(context_->get(), request_.data(), MODBUS_EXCEPTION_ILLEGAL_FUNCTION);
  return std::nullopt;
}

void ModbusServer::answer(int first_input, std::span<const std::uint8_t> inputs) {
  modbus_mapping_t* mapping =
      modbus_mapping_new_start_address(0, 0, static_cast<unsigned int>(first_input),
                                       static_cast<unsigned int>(inputs.size()), 0, 0, 0, 0);
  if (mapping == nullptr) throw JobError("no memory for a unit's inputs");
  std::ranges::copy(inputs, mapping->tab_input_bits);
  modbus_reply(context_->get(), request_.data(), request_length_, mapping);
  modbus_mapping_free(mapping);
}

}  // namespace holdfast
