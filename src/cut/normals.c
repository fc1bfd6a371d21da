/* SPDX-License-Identifier: BSD-3-Clause */
#include <math.h>

#include "src/cut/cut.h"

static void add_to(float *normal, const float *n)
{
    for (int i = 0; i < 3; i++)
        normal[i] += n[i];
}

void cut_normals(const struct cut *cut, const float *points, float *normals)
{
    for (size_t i = 0; i < 3 * (size_t)cut->vertex_count; i++)
        normals[i] = 0;
    for (size_t t = 0; t < cut->triangle_count; t++) {
        const uint32_t *triangle = cut->triangles + 3 * t;
        const float *a = points + 3 * (size_t)triangle[0], *b = points + 3 * (size_t)triangle[1],
                    *c = points + 3 * (size_t)triangle[2];
        float ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], vx = c[0] - a[0], vy = c[1] - a[1],
              vz = c[2] - a[2];
        float n[3] = {uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx}; // twice the area long
        for (int i = 0; i < 3; i++)
            add_to(normals + 3 * (size_t)triangle[i], n);
    }
    for (size_t v = 0; v < cut->vertex_count; v++) {
        float *n = normals + 3 * v;
        double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]); // float would underflow
        if (length > 0)
            for (int i = 0; i < 3; i++)
                n[i] = (float)(n[i] / length);
        else
            n[2] = 1; // of triangles without area: any
    }
}
