/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/rounds/quadric.h"

#include <math.h>

/* Place of row i, column j >= i of the 5 x 5 matrix. */
static int at(int i, int j)
{
    static const int row[5] = {0, 5, 9, 12, 14};
    return row[i] + j - i;
}

static void add_square(double *quadric, const double v[5], double weight)
{
    for (int i = 0; i < 5; i++)
        for (int j = i; j < 5; j++)
            quadric[at(i, j)] += weight * v[i] * v[j];
}

void quadric_add_field(double quadric[QUADRIC_SIZE], const double gradient[3], double constant, double weight)
{
    const double v[5] = {gradient[0], gradient[1], gradient[2], -1, constant};
    add_square(quadric, v, weight);
}

/* A unit vector normal to three edges in R^4: their generalised cross product. False: they do not span a volume. */
static bool normal4(const double points[4][4], double n[4])
{
    double e[3][4], length2 = 0;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 4; i++)
            e[k][i] = points[k + 1][i] - points[0][i];
    for (int i = 0; i < 4; i++) {
        int a = (i + 1) % 4, b = (i + 2) % 4, c = (i + 3) % 4;
        n[i] = e[0][a] * (e[1][b] * e[2][c] - e[1][c] * e[2][b]) + e[0][b] * (e[1][c] * e[2][a] - e[1][a] * e[2][c]) +
               e[0][c] * (e[1][a] * e[2][b] - e[1][b] * e[2][a]);
        n[i] *= i % 2 ? -1 : 1; // the cyclic order of three indices out of four alternates in sign
        length2 += n[i] * n[i];
    }
    for (int i = 0; i < 4 && length2 > 0; i++)
        n[i] /= sqrt(length2);
    return length2 > 0;
}

void quadric_add_distance(double quadric[QUADRIC_SIZE], const double points[4][4], double weight)
{
    double v[5];
    if (!normal4(points, v))
        return;
    v[4] = 0;
    for (int i = 0; i < 4; i++)
        v[4] -= v[i] * points[0][i];
    add_square(quadric, v, weight);
}

double quadric_weight(const double quadric[QUADRIC_SIZE])
{
    return quadric[at(3, 3)];
}

double quadric_at(const double quadric[QUADRIC_SIZE], const double p[3], double s)
{
    const double v[5] = {p[0], p[1], p[2], s, 1};
    double sum = 0;
    for (int i = 0; i < 5; i++)
        for (int j = i; j < 5; j++)
            sum += (i == j ? 1 : 2) * quadric[at(i, j)] * v[i] * v[j];
    return sum > 0 ? sum : 0;
}

double quadric_least_at(const double quadric[QUADRIC_SIZE], const double p[3], double *s)
{
    double linear = quadric[at(3, 4)];
    for (int i = 0; i < 3; i++)
        linear += quadric[at(i, 3)] * p[i];
    if (quadric[at(3, 3)] > 0)
        *s = -linear / quadric[at(3, 3)];
    return quadric_at(quadric, p, *s);
}

bool quadric_optimum(const double quadric[QUADRIC_SIZE], double p[3])
{
    double m[4][5]; // A (x, y, z, s) = -b by elimination with pivoting
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++)
            m[i][j] = quadric[i <= j ? at(i, j) : at(j, i)];
        m[i][4] = -quadric[at(i, 4)];
    }
    double largest = 0;
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int i = k + 1; i < 4; i++)
            pivot = fabs(m[i][k]) > fabs(m[pivot][k]) ? i : pivot;
        largest = fmax(largest, fabs(m[pivot][k]));
        if (!(fabs(m[pivot][k]) > 1e-10 * largest))
            return false;
        for (int j = 0; j < 5; j++) {
            double swap = m[k][j];
            m[k][j] = m[pivot][j];
            m[pivot][j] = swap;
        }
        for (int i = 0; i < 4; i++) {
            double factor = i == k ? 0 : m[i][k] / m[k][k];
            for (int j = k; j < 5; j++)
                m[i][j] -= factor * m[k][j];
        }
    }
    for (int i = 0; i < 3; i++)
        p[i] = m[i][4] / m[i][i];
    return true;
}
