// Banks of modes against vectors of independent code.

#include "tests/unit/estimators/multiple_model/golden_modes.h"

namespace holdfast {
namespace {

using namespace testing;

constexpr double kBankTolerance = 1e-8;

struct BankRun {
  nlohmann::json file;
  std::vector<SystemModel> modes;

  explicit BankRun(const std::string& name)
      : file(golden_file("multiple_model/mm_" + name + ".json")) {
    for (const nlohmann::json& system : file.at("systems")) modes.push_back(mode_of(system));
  }

  template <class Tell>
  void take(ModeBank& bank, const Tell& tell) const {
    const std::vector<int> rows = all_rows(modes.front());
    bank.start({vector_of(file.at("x0")), matrix_of(file.at("P0"))});
    for (std::size_t k = 0; k < file.at("y").size(); ++k) {
      const ModeBank::Result result =
          bank.step(rows, vector_of(file.at("y").at(k)), vector_or_none(file.at("u").at(k)));
      CHECK(result == (k == 0 ? ModeBank::Result::kStarted : ModeBank::Result::kCorrected));
      if (k > 0) tell(k - 1);
    }
  }
};

const std::vector<std::string> kBanks = {"benchmark", "three_area", "different_p"};

Eigen::VectorXd as_vector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace

TEST_CASE("static banks agree with the vectors by every likelihood and floor") {
  using Floor = ModeBankOptions::FloorRule;
  const std::vector<std::pair<std::string, InputLikelihood>> likelihoods = {
      {"paper", InputLikelihood::kPaper},
      {"ortho", InputLikelihood::kOrtho},
      {"flat", InputLikelihood::kFlat}};
  for (const std::string& name : kBanks) {
    const BankRun run(name);
    for (const auto& [likelihood_name, likelihood] : likelihoods) {
      for (const Floor floor : {Floor::kPrinted, Floor::kNormalised}) {
        const std::string key =
            likelihood_name + (floor == Floor::kPrinted ? "/printed" : "/normalised");
        const nlohmann::json& wanted = run.file.at("static").at(key);
        ModeBankOptions options;
        options.filter.likelihood = likelihood;
        options.floor = run.file.at("eps");
        options.floor_rule = floor;
        ModeBank bank(run.modes, options);
        run.take(bank, [&](std::size_t k) {
          INFO(name << ", " << key << ", step " << k + 1);
          CHECK(difference(as_vector(bank.log_likelihood()),
                           vector_of(wanted.at("loglik").at(k))) <= kBankTolerance);
          CHECK(difference(as_vector(bank.probability()), vector_of(wanted.at("mu").at(k))) <=
                kBankTolerance);
          CHECK(bank.most_probable() == wanted.at("mode").at(k));
          const InputStateFilter& chosen = bank.filter(bank.most_probable());
          CHECK(difference(chosen.mean(), vector_of(wanted.at("x").at(k))) <= kBankTolerance);
          CHECK(difference(chosen.previous_input(), vector_or_none(wanted.at("d").at(k))) <=
                kBankTolerance);
        });
      }
    }
  }
}

TEST_CASE("banks of modes that change agree with the vectors") {
  for (const std::string& name : kBanks) {
    const BankRun run(name);
    const nlohmann::json& wanted = run.file.at("dynamic");
    ModeBankOptions options;
    options.floor = 0.0;
    options.transition = matrix_of(run.file.at("Pi"));
    ModeBank bank(run.modes, options);
    run.take(bank, [&](std::size_t k) {
      INFO(name << ", step " << k + 1);
      CHECK(difference(as_vector(bank.log_likelihood()), vector_of(wanted.at("loglik").at(k))) <=
            kBankTolerance);
      CHECK(difference(as_vector(bank.probability()), vector_of(wanted.at("mu").at(k))) <=
            kBankTolerance);
      CHECK(bank.most_probable() == wanted.at("mode").at(k));
      const InputStateFilter& chosen = bank.filter(bank.most_probable());
      CHECK(difference(chosen.mean(), vector_of(wanted.at("x").at(k))) <= kBankTolerance);
      CHECK(difference(chosen.previous_input(), vector_or_none(wanted.at("d").at(k))) <=
            kBankTolerance);
      Eigen::VectorXd mixture = Eigen::VectorXd::Zero(chosen.mean().size());
      for (int j = 0; j < bank.num_modes(); ++j)
        mixture += bank.probability()[static_cast<std::size_t>(j)] * bank.filter(j).mean();
      CHECK(difference(mixture, vector_of(wanted.at("xmix").at(k))) <= kBankTolerance);
      for (int j = 0; j < bank.num_modes(); ++j) {
        CHECK(difference(bank.filter(j).mean(),
                         vector_of(wanted.at("xj").at(k).at(static_cast<std::size_t>(j)))) <=
              kBankTolerance);
      }
    });
  }
}

}  // namespace holdfast
