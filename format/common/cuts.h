/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which page of a group a tetrahedron belongs to (SPEC 7.6): a tree of cuts halves space again and again, and the
 * middle of the tetrahedron's bounding box decides. It does not depend on the order of the corners. Not installed.
 */
#ifndef TETLOD_CUTS_H
#define TETLOD_CUTS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CUT_PAGE = 3, MAX_CUTS = 64 /* between the whole and a page */ };

/* A node of the tree, of which the nodes are listed in preorder. */
struct tetlodi_cut {
    uint8_t axis; /* 0, 1, 2: what is below `at` goes to the next node, the rest to `beyond`; CUT_PAGE: it is page
                     `beyond` */
    float at;
    uint32_t beyond;
};

/* A level whose records are in pages (SPEC 7.6). A page's contractions are of vertices whose tetrahedra, before and
 * after, all lie in its part of the tree. */
struct tetlodi_write_group {
    struct tetlodi_cut *tree; /* [nodes] in preorder, with pages 0, 1, ... in this order */
    uint32_t nodes, pages;
    uint32_t *ends; /* [page] its contractions end here; they begin where those of the page before, or the finer
                       level's, end */
};

/* What lies at `least` and below `most`. */
struct tetlodi_box {
    double least[3], most[3];
};

static inline void tetlodi_middle_of_box(const double *const points[4], double middle[3])
{
    for (int axis = 0; axis < 3; axis++) {
        double least = points[0][axis], most = least;
        for (int c = 1; c < 4; c++) {
            double x = points[c][axis];
            least = x < least ? x : least;
            most = x > most ? x : most;
        }
        middle[axis] = (least + most) / 2;
    }
}

static inline bool tetlodi_in_box(const struct tetlodi_box *box, const double point[3])
{
    return point[0] >= box->least[0] && point[0] < box->most[0] && point[1] >= box->least[1] &&
           point[1] < box->most[1] && point[2] >= box->least[2] && point[2] < box->most[2];
}

/* Finds pages of tetrahedra that mostly are in the same one as those before: `page` is what lies in `box`. */
struct tetlodi_page_finder {
    const struct tetlodi_cut *tree;
    struct tetlodi_box box;
    uint32_t page;
};

static inline struct tetlodi_page_finder tetlodi_page_finder(const struct tetlodi_cut *tree)
{
    return (struct tetlodi_page_finder){.tree = tree, .box = {.least = {INFINITY}}}; // there is nothing yet
}

static inline uint32_t tetlodi_page_at(struct tetlodi_page_finder *finder, const double middle[3])
{
    if (tetlodi_in_box(&finder->box, middle))
        return finder->page;
    const struct tetlodi_cut *cut = finder->tree;
    finder->box = (struct tetlodi_box){{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
    while (cut->axis != CUT_PAGE) {
        if (middle[cut->axis] < (double)cut->at) {
            finder->box.most[cut->axis] = cut->at;
            cut++;
        } else {
            finder->box.least[cut->axis] = cut->at;
            cut = finder->tree + cut->beyond;
        }
    }
    return finder->page = cut->beyond;
}

/* The page of a tetrahedron, by its corners' numbers. */
static inline uint32_t tetlodi_page_at_corners(struct tetlodi_page_finder *finder, const double *positions,
                                               const uint32_t corners[4])
{
    const double *points[4];
    double middle[3];
    for (int c = 0; c < 4; c++)
        points[c] = positions + 3 * (size_t)corners[c];
    tetlodi_middle_of_box(points, middle);
    return tetlodi_page_at(finder, middle);
}

#endif
