/* SPDX-License-Identifier: BSD-3-Clause */
/* How far the boundary may move, against the distances of all pairs of faces: on fans of needles, whose boxes all
 * meet. */
#include "src/simplify/mesh/clearance.h"

#include <math.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { SECTORS = 40, VERTICES = SECTORS + 2, FACES = 2 * SECTORS };

/* Sectors around the line from vertex 0 to vertex 1, with a rim that is not level; the faces over and under them. */
static void make_fan(uint64_t *random, double positions[VERTICES][3], uint32_t corners[SECTORS][4],
                     uint32_t faces[FACES][3])
{
    double height = 0.2 + gen_unit(random), far = gen_unit(random) < 0.5 ? 1e5 : 0;
    memset(positions, 0, 2 * sizeof *positions);
    positions[1][2] = height;
    for (uint32_t i = 0; i < SECTORS; i++) {
        double angle = 2 * 3.14159265358979323846 * i / SECTORS, radius = 0.5 + gen_unit(random);
        double at[3] = {radius * cos(angle), radius * sin(angle), height * (0.5 + 0.2 * gen_unit(random))};
        uint32_t sector[4] = {0, 1, 2 + i, 2 + (i + 1) % SECTORS};
        memcpy(positions[2 + i], at, sizeof at);
        memcpy(corners[i], sector, sizeof sector);
        for (int f = 0; f < 2; f++)
            for (int k = 0; k < 3; k++)
                faces[2 * i + (uint32_t)f][k] = sector[tet_faces[f][k]];
    }
    for (uint32_t v = 0; v < VERTICES; v++)
        positions[v][0] += far;
}

/* Squared; INFINITY if one is no other part of the boundary to the other. */
static double distance2_of(double (*positions)[3], const uint32_t a[3], const uint32_t b[3])
{
    const double *p[3], *q[3];
    double m[3], n[3];
    for (int i = 0; i < 3; i++) {
        p[i] = positions[a[i]];
        q[i] = positions[b[i]];
        for (int k = 0; k < 3; k++)
            if (a[i] == b[k])
                return INFINITY;
    }
    triangle_cross(p[0], p[1], p[2], m);
    triangle_cross(q[0], q[1], q[2], n);
    return dot(m, n) < -0.2 * sqrt(dot(m, m) * dot(n, n)) ? triangles_distance2(p, q) : INFINITY;
}

static void test_fans(void)
{
    static double positions[VERTICES][3];
    static uint32_t corners[SECTORS][4], faces[FACES][3];
    uint64_t random = 5;
    uint32_t near = 0;
    for (int seed = 0; seed < 20; seed++) {
        double limit = 0.01 + 0.1 * gen_unit(&random), found[VERTICES];
        make_fan(&random, positions, corners, faces);
        struct clearance_mesh mesh = {.positions = positions[0], .corners = corners[0], .triangles = faces[0],
                                      .vertex_count = VERTICES, .tet_count = SECTORS, .triangle_count = FACES};
        REQUIRE(clearance_find(&mesh, limit, 0, 1, found, NULL) == TETLOD_OK);
        for (uint32_t v = 0; v < VERTICES; v++) {
            double least = limit;
            for (uint32_t f = 0; f < FACES; f++)
                for (uint32_t g = 0; g < FACES && (faces[f][0] == v || faces[f][1] == v || faces[f][2] == v); g++)
                    least = smaller(least, 0.2 * sqrt(distance2_of(positions, faces[f], faces[g])));
            CHECK_NEAR(found[v], least, 1e-12);
            near += least < limit;
        }
    }
    CHECK(near > 100 && near < 20 * VERTICES);
}

int main(void)
{
    RUN(test_fans);
    return test_end();
}
