// Pinocchio's aba again and again, over given states in turn. The model is rebuilt from plain numbers.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>
#include <ctime>

namespace pin = pinocchio;

static double now() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

// kind: 0 free flyer; 1, 2, 3 revolute about x, y, z; 4 revolute about `axis`; 5 prismatic along `axis`.
// place: rotation (row by row) and translation; mass: m, centre, inertia about it (row by row).
static pin::JointIndex add(pin::Model &model, int parent, int kind, const double *axis, const double *place,
                           const double *mass, const char *name) {
    typedef Eigen::Matrix<double, 3, 3, Eigen::RowMajor> Rows;
    const pin::SE3 where(Eigen::Map<const Rows>(place), Eigen::Map<const Eigen::Vector3d>(place + 9));
    const Eigen::Vector3d along = Eigen::Map<const Eigen::Vector3d>(axis);
    pin::JointIndex index = 0;
    switch (kind) {
        case 0: index = model.addJoint(parent, pin::JointModelFreeFlyer(), where, name); break;
        case 1: index = model.addJoint(parent, pin::JointModelRX(), where, name); break;
        case 2: index = model.addJoint(parent, pin::JointModelRY(), where, name); break;
        case 3: index = model.addJoint(parent, pin::JointModelRZ(), where, name); break;
        case 4: index = model.addJoint(parent, pin::JointModelRevoluteUnaligned(along), where, name); break;
        default: index = model.addJoint(parent, pin::JointModelPrismaticUnaligned(along), where, name); break;
    }
    const pin::Inertia body(mass[0], Eigen::Map<const Eigen::Vector3d>(mass + 1),
                            Eigen::Matrix3d(Eigen::Map<const Rows>(mass + 4)));
    model.appendBodyToJoint(index, body, pin::SE3::Identity());
    return index;
}

// Processor time [s] of `evaluations`. `check` takes the sum of the accelerations.
extern "C" double pinocchio_loop(int joints, const int *parent, const int *kind, const double *axis,
                                 const double *place, const double *mass, const double *rotor,
                                 const double *gravity, const double *q, const double *v, const double *force,
                                 int states, long evaluations, double *check) {
    pin::Model model;
    for (int k = 0; k < joints; ++k) {
        const std::string name = "joint" + std::to_string(k);
        add(model, parent[k], kind[k], axis + 3 * k, place + 12 * k, mass + 13 * k, name.c_str());
    }
    model.gravity.linear() = Eigen::Map<const Eigen::Vector3d>(gravity);
    model.armature = Eigen::Map<const Eigen::VectorXd>(rotor, model.nv);
    pin::Data data(model);
    Eigen::VectorXd qk(model.nq), vk(model.nv), fk(model.nv);
    double sum = 0, used = 0;
    for (int warm = 1; warm >= 0; --warm) {
        sum = 0;
        int k = 0;
        const double start = now();
        for (long e = 0; e < (warm ? states : evaluations); ++e) {
            qk = Eigen::Map<const Eigen::VectorXd>(q + long(k) * model.nq, model.nq);
            vk = Eigen::Map<const Eigen::VectorXd>(v + long(k) * model.nv, model.nv);
            fk = Eigen::Map<const Eigen::VectorXd>(force + long(k) * model.nv, model.nv);
            sum += pin::aba(model, data, qk, vk, fk, pin::Convention::LOCAL).sum();
            if (++k == states) k = 0;
        }
        used = now() - start;
    }
    *check = sum;
    return used;
}
