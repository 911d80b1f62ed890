// Times Pinocchio on the trees of crates/sim/benches/articulated.rs, one thread.
//
//   pip install pin; apt-get install libeigen3-dev
//   P=$(python -c "import cmeel, pathlib; print(pathlib.Path(cmeel.__file__).parents[1] / 'cmeel.prefix')")
//   g++ -std=c++17 -O3 -march=native -DNDEBUG -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12 -DFUSION_MAX_VECTOR_SIZE=12 -I$P/include -I/usr/include/eigen3 articulated_pinocchio.cpp -o articulated_pinocchio
//   ./articulated_pinocchio
//
// Pinocchio's templates are compiled here, with this machine's instructions; nothing is linked but headers.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

using namespace pinocchio;

const int EVALUATIONS = 2000;
const int ROUNDS = 15;

Model tree(int joints, bool floats) {
  Model model;
  const SE3 placement(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.1, 0.05, 0.2));
  const Inertia inertia(1.0, Eigen::Vector3d(0.02, -0.01, 0.1),
                        Eigen::Vector3d(0.01, 0.012, 0.008).asDiagonal().toDenseMatrix());
  auto push = [&](auto joint, JointIndex parent) {
    const JointIndex index = model.addJoint(parent, joint, placement, std::to_string(model.njoints));
    model.appendBodyToJoint(index, inertia, SE3::Identity());
    return index;
  };
  JointIndex root = 0;
  if (floats) root = push(JointModelFreeFlyer(), 0);
  JointIndex parent = root;
  for (int joint = 0; joint < joints; ++joint) {
    if (joint % 6 == 0 && floats) parent = root;
    switch (joint % 3) {
      case 0: parent = push(JointModelRX(), parent); break;
      case 1: parent = push(JointModelRY(), parent); break;
      default: parent = push(JointModelRZ(), parent);
    }
  }
  return model;
}

void time(const std::string& name, const std::function<void()>& evaluate) {
  double best = std::numeric_limits<double>::infinity();
  for (int round = 0; round < ROUNDS; ++round) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < EVALUATIONS; ++i) evaluate();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    best = std::min(best, took.count() / EVALUATIONS);
  }
  std::printf("%-40s %8.2f µs\n", name.c_str(), best * 1e6);
}

int main() {
  for (const bool floats : {false, true}) {
    const Model model = floats ? tree(30, true) : tree(7, false);
    Data data(model);
    const auto vector = [&](double phase) {
      Eigen::VectorXd all(model.nv);
      for (int k = 0; k < model.nv; ++k) all[k] = std::sin(k + phase);
      return all;
    };
    const Eigen::VectorXd q = integrate(model, neutral(model), vector(0.3)), v = vector(0.7), tau = vector(1.1);
    const std::string of = ", " + std::to_string(model.nv) + " degrees of freedom";
    time("inverse dynamics" + of, [&] { rnea(model, data, q, v, tau); });
    time("forward dynamics" + of, [&] { aba(model, data, q, v, tau); });
    time("mass matrix" + of, [&] { crba(model, data, q); });
    time("derivatives of inverse dynamics" + of, [&] { computeRNEADerivatives(model, data, q, v, tau); });
    time("derivatives of forward dynamics" + of, [&] { computeABADerivatives(model, data, q, v, tau); });
  }
}
