/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Building streams from arrays in memory: the public interface of libtetlod-build, with libtetlod's conventions
 * (tetlod.h).
 *
 * A solver passes its mesh and its fields and receives the bytes of the stream in order. The bytes are those that
 * `tetlod build` writes of the same mesh, with the same options and metadata. Nothing of the mesh is changed or kept.
 *
 *     struct tetlod_build_array p = {.name = "p", .components = 1, .type = TETLOD_CELL_FLOAT64, .values = pressure};
 *     struct tetlod_build_mesh mesh = {.struct_size = sizeof mesh, .vertices = n, .tets = m};
 *     struct tetlod_error error = {TETLOD_OK, 0, ""};
 *     mesh.position_type = TETLOD_FLOAT64;
 *     mesh.positions = xyz;
 *     mesh.corners = tets;
 *     mesh.field_count = 1;
 *     mesh.fields = &p;
 *     enum tetlod_status status = tetlod_build(&mesh, NULL, write_bytes, file, &error);
 *     if (status != TETLOD_OK)
 *         fprintf(stderr, "%s\n", error.message);
 *
 * Ownership.
 *
 *     what                                      whose, and how long
 *     mesh, arrays, names                       borrowed for the call
 *     options and their texts                   borrowed for the call; of a series until it is freed
 *     bytes that `write` gets                   the library's, for that call
 *     series                                    the caller's: tetlod_build_series_free
 *
 * Caveats. Set struct_size: it says how much of a struct the caller knows. Points that no tetrahedron uses are dropped.
 * Values of points that are not finite are refused. 64 bit integers beyond 2^53 are refused. The memory of a build is
 * about 115 bytes a tetrahedron beside the arrays, and their copy. Threads are the library's own, and end before the
 * call does; the callbacks are called by the calling thread.
 */
#ifndef TETLOD_BUILD_PUBLIC_H
#define TETLOD_BUILD_PUBLIC_H

#include "format/tetlod.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Values of the points or of the tetrahedra, one row after the other. */
struct tetlod_build_array {
    const char *name;
    uint32_t components;        /* values in a row */
    enum tetlod_cell_type type; /* of a value; at points TETLOD_CELL_FLOAT32 or TETLOD_CELL_FLOAT64 */
    const void *values;         /* [components * rows] */
};

/* Borrowed for the call. */
struct tetlod_build_mesh {
    size_t struct_size; /* sizeof(struct tetlod_build_mesh) */
    uint32_t vertices, tets;
    enum tetlod_type position_type;
    const void *positions;   /* [3 * vertices] of that type */
    const uint32_t *corners; /* [4 * tets] 0-based */
    uint32_t field_count, cell_field_count;
    const struct tetlod_build_array *fields;      /* values of the points; integers are ids */
    const struct tetlod_build_array *cell_fields; /* values of the tetrahedra, stored exactly */
};

/* tetlod_build_defaults sets what `tetlod build` does without options. `tetlod help build` says more about each of
 * them. */
struct tetlod_build_options {
    size_t struct_size;
    const char *const
        *controls; /* fields whose error is certified: "p", "p:1%", "U:mag", "U:0", lists "p,U", patterns "p*", "all";
                    * none: all but ids; where there is no such field, a coordinate of the points */
    uint32_t control_count;
    const char *region;          /* field of the tetrahedra that tells regions; "none"; NULL: integers of few values */
    double max_error;            /* stop at this error, a fraction of the range */
    uint32_t min_tets;           /* stop at that many tetrahedra */
    double domain_error;         /* how far the boundary may move, a fraction of the diagonal */
    double boundary_angle;       /* degrees between boundary faces that make a crease */
    double growth;               /* vertices of a level / vertices of the one below */
    int certify_exact;           /* 1: the exact maximum is the limit: fewer tetrahedra, more time */
    int certify_all;             /* 1: a certified error for every field */
    /* 1: a field "NAME bound" of each controlled one: how far off it is at most at each point */
    int local_bound;
    unsigned position_bits, field_bits;   /* round to so many bits; 0: lossless */
    double position_error, field_error;   /* as many bits as keep this error; 0: lossless */
    int keep_order;              /* 1: store the numbering of the arrays, too; a large mesh that is not in order of
                                  * space is then not sorted first, and may take longer */
    int compression;             /* 1 fast .. 22 small */
    unsigned threads;            /* 1 .. 64; 0: all cores; the bytes do not depend on it */
    uint64_t memory;             /* refuse what needs more bytes; 0: no limit */
    const char *metadata;        /* a JSON object; NULL: which program made the stream */
    /* Called now and then, always by the calling thread; `done` is a fraction of the phase. Returns 0 to cancel. May be
     * NULL. */
    int (*progress)(void *opaque, const char *phase, double done);
    void *progress_opaque;
    /* Called with what the build found in the mesh: inverted tetrahedra, say. A line without its end, valid for the
     * call. May be NULL. */
    void (*warn)(void *opaque, const char *line);
    void *warn_opaque;
    const char *const *without; /* fields that are not controlled: names, lists, patterns */
    uint32_t without_count;
    int summary;                /* 1: exact sums over the original, for `tetlod ask` */
    double keep_features;       /* levels keep the extrema of this persistence, a fraction of the range; 0: they need
                                 * not */
};

TETLOD_API void tetlod_build_defaults(struct tetlod_build_options *options);

/* Builds the stream of a mesh and passes its bytes on in order: `write` returns TETLOD_OK, or a status that ends the
 * build. `options` NULL: the defaults. TETLOD_ERR_MESH and TETLOD_ERR_FIELD name what is wrong with the arrays;
 * TETLOD_ERR_ARGUMENT an option; TETLOD_ERR_CANCELLED if progress returned 0; TETLOD_ERR_LIMIT and TETLOD_ERR_NOMEM. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_build(const struct tetlod_build_mesh *mesh,
                                                          const struct tetlod_build_options *options,
                                                          enum tetlod_status (*write)(void *opaque, const void *bytes,
                                                                                      size_t size),
                                                          void *opaque, struct tetlod_error *error);

/*
 * A series: steps of one mesh are added while a solver runs, and the stream is written at the end. The values of steps
 * wait in a temporary file (TMPDIR). The controlled fields have steps, and so have those of the tetrahedra, which
 * are stored exactly; other fields have the first step's values. A field of the tetrahedra that a step lacks, or has
 * with other components, is known at the first step alone.
 *
 *     status = tetlod_build_series_new(&series, NULL, &error);
 *     ... tetlod_build_series_add(series, &mesh, time, &error) after each step, with the same points and tetrahedra
 *     status = tetlod_build_series_finish(series, write_bytes, file, &error);
 *     tetlod_build_series_free(series);
 */
struct tetlod_build_series;

/* The texts of the options are borrowed until the series is freed. domain_error counts as 0. TETLOD_ERR_ARGUMENT:
 * certify_exact, certify_all, local_bound, keep_features and rounding are for one mesh. *out is to be freed also after
 * a failure. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_build_series_new(struct tetlod_build_series **out,
                                                                     const struct tetlod_build_options *options,
                                                                     struct tetlod_error *error);

/* Adds a step; nothing of the mesh is kept. Times rise. After TETLOD_ERR_ARGUMENT for the time, or a mesh that is not
 * valid, the series goes on without the step; after any other failure it cannot be finished. */
TETLOD_API TETLOD_CHECKED enum tetlod_status tetlod_build_series_add(struct tetlod_build_series *series,
                                                                     const struct tetlod_build_mesh *mesh, double time,
                                                                     struct tetlod_error *error);

/* Builds the stream of all steps, as tetlod_build does. */
TETLOD_API TETLOD_CHECKED enum tetlod_status
tetlod_build_series_finish(struct tetlod_build_series *series,
                           enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size), void *opaque,
                           struct tetlod_error *error);
TETLOD_API void tetlod_build_series_free(struct tetlod_build_series *series);

#ifdef __cplusplus
}
#endif
#endif
