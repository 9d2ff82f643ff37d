// The methods that Müller et al. 2016 compare, for batches: appendix C (Irving et al. 2004) and appendix D (the torque
// iteration) with the paper's thresholds, which are absolute, and Eigen's singular value decomposition.
// Matrices are rows of nine numbers. The code follows the paper's description of its algorithms.

#include <Eigen/Dense>
#include <cmath>

namespace {

template <class T> using Matrix = Eigen::Matrix<T, 3, 3>;
template <class T> using Vector = Eigen::Matrix<T, 3, 1>;
template <class T> using Rows = Eigen::Matrix<T, 3, 3, Eigen::RowMajor>;

template <class T> Matrix<T> read(const T *matrices, long n) { return Eigen::Map<const Rows<T>>(matrices + 9 * n); }

template <class T> void write(T *rotations, long n, const Matrix<T> &r) { Eigen::Map<Rows<T>>(rotations + 9 * n) = r; }

// Zeroes the largest off-diagonal entry, at most ten times. Returns the eigenvectors; `d` ends diagonal.
template <class T> Matrix<T> eigenvectors(Matrix<T> &d) {
    static const int pairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    Matrix<T> v = Matrix<T>::Identity();
    for (int sweep = 0; sweep < 10; ++sweep) {
        int p = 0, q = 1;
        for (const auto &pair : pairs)
            if (std::abs(d(pair[0], pair[1])) > std::abs(d(p, q))) p = pair[0], q = pair[1];
        if (std::abs(d(p, q)) < T(1e-15)) break;
        const T cotangent = (d(p, p) - d(q, q)) / (2 * d(p, q));
        const T tangent = std::copysign(T(1), cotangent) / (std::abs(cotangent) + std::sqrt(cotangent * cotangent + 1));
        const T cosine = 1 / std::sqrt(tangent * tangent + 1), sine = tangent * cosine;
        Matrix<T> turn = Matrix<T>::Identity();
        turn(p, p) = turn(q, q) = cosine;
        turn(q, p) = sine;
        turn(p, q) = -sine;
        d = turn.transpose() * d * turn;
        d(p, q) = d(q, p) = 0;
        v = v * turn;
    }
    return v;
}

template <class T> Matrix<T> irving(const Matrix<T> &a) {
    Matrix<T> d = a.transpose() * a;
    Matrix<T> v = eigenvectors(d);
    const Vector<T> sigma = d.diagonal().cwiseMax(T(0)).cwiseSqrt();
    int smallest = 0, small = 0, last = 0;
    for (int k = 0; k < 3; ++k) {
        if (d(k, k) < d(smallest, smallest)) smallest = k;
        if (sigma[k] < T(1e-4)) ++small, last = k;
    }
    if (v.determinant() < 0) v.col(smallest) *= -1;
    if (small > 1) return v.transpose();
    Matrix<T> u = a * v;
    for (int k = 0; k < 3; ++k)
        if (small == 0 || k != last) u.col(k) /= sigma[k];
    if (small == 1)
        u.col(last) = u.col((last + 1) % 3).cross(u.col((last + 2) % 3)).normalized();
    else if (u.determinant() < 0)
        u.col(smallest) *= -1;
    return u * v.transpose();
}

template <class T> Matrix<T> torque(const Matrix<T> &a, Eigen::Quaternion<T> q, long iterations) {
    for (long iteration = 0; iteration < iterations; ++iteration) {
        const Matrix<T> r = q.matrix();
        Vector<T> omega = Vector<T>::Zero();
        T trace = 0;
        for (int k = 0; k < 3; ++k) {
            omega += r.col(k).cross(a.col(k));
            trace += r.col(k).dot(a.col(k));
        }
        omega *= 1 / std::abs(trace) + T(1e-9);
        const T angle = omega.norm();
        if (angle < T(1e-9)) break;
        q = Eigen::Quaternion<T>(Eigen::AngleAxis<T>(angle, omega / angle)) * q;
        q.normalize();
    }
    return q.matrix();
}

template <class T> Matrix<T> jacobi_svd(const Matrix<T> &a) {
    const Eigen::JacobiSVD<Matrix<T>> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix<T> u = svd.matrixU();
    if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
    return u * svd.matrixV().transpose();
}

} // namespace

#define BATCHED(METHOD, DTYPE, T)                                                                                      \
    extern "C" void METHOD##_##DTYPE(const T *matrices, T *rotations, long count) {                                    \
        _Pragma("omp parallel for") for (long n = 0; n < count; ++n)                                                   \
            write<T>(rotations, n, METHOD<T>(read<T>(matrices, n)));                                                   \
    }

// Without starts from the quaternion that Eigen makes of A itself, which is no rotation.
#define BATCHED_TORQUE(DTYPE, T)                                                                                       \
    extern "C" void torque_##DTYPE(const T *matrices, const T *starts, T *rotations, long count, long iterations) {    \
        _Pragma("omp parallel for") for (long n = 0; n < count; ++n) {                                                 \
            const Matrix<T> a = read<T>(matrices, n);                                                                  \
            const Eigen::Quaternion<T> q(starts ? read<T>(starts, n) : a);                                             \
            write<T>(rotations, n, torque<T>(a, q.normalized(), iterations));                                          \
        }                                                                                                              \
    }

BATCHED(irving, float32, float)
BATCHED(irving, float64, double)
BATCHED(jacobi_svd, float32, float)
BATCHED(jacobi_svd, float64, double)
BATCHED_TORQUE(float32, float)
BATCHED_TORQUE(float64, double)
