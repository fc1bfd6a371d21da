/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * refine URL ERROR: refines a mesh while its bytes arrive, in steps that never take long, and says how far vertices
 * move from level to level: what a viewer needs to let them slide to their places instead of jumping.
 *
 * cc refine.c $(pkg-config --cflags --libs tetlod libcurl) -lm -o refine
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <curl/curl.h>
#include <tetlod.h>

enum { RECORDS = 500 }; /* of one step: less than a frame's time */

struct viewer {
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor;
    struct tetlod_error error;
};

/* A viewer would draw vertex v at origin + t * (position - origin), t from 0 to 1. */
static enum tetlod_status show(struct viewer *viewer, uint32_t from)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(viewer->cursor, &mesh);
    double *origins = malloc(3 * sizeof *origins * mesh.vertices), farthest = 0;
    if (!origins)
        return TETLOD_ERR_NOMEM;
    enum tetlod_status status = tetlod_cursor_origins(viewer->cursor, from, origins, NULL, &viewer->error);
    for (size_t v = 0; v < mesh.vertices && status == TETLOD_OK; v++) {
        const double *p = mesh.positions + 3 * v, *q = origins + 3 * v;
        farthest = fmax(farthest, hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]));
    }
    if (status == TETLOD_OK)
        printf("level %u: %u tetrahedra, vertices slide by up to %.3g\n", mesh.level, mesh.tets, farthest);
    free(origins);
    return status;
}

/* Shows every level that is there by now. */
static enum tetlod_status refine(struct viewer *viewer)
{
    uint32_t there = tetlod_feed_level(viewer->feed);
    enum tetlod_status status = TETLOD_OK;
    struct tetlod_mesh mesh;
    if (there == TETLOD_NONE)
        return TETLOD_OK;
    if (!viewer->cursor)
        status = tetlod_cursor_new(&viewer->cursor, tetlod_feed_file(viewer->feed), NULL, 0, &viewer->error);
    while (status == TETLOD_OK) {
        tetlod_cursor_mesh(viewer->cursor, &mesh);
        if (mesh.level == there)
            break;
        uint32_t from = mesh.level;
        do /* a viewer draws and handles input between two steps */
            status = tetlod_cursor_step(viewer->cursor, from + 1, RECORDS, &viewer->error);
        while (status == TETLOD_MORE);
        if (status == TETLOD_OK)
            status = show(viewer, from);
    }
    return status;
}

static size_t arrive(char *data, size_t one, size_t count, void *opaque)
{
    struct viewer *viewer = opaque;
    enum tetlod_status status = tetlod_feed_add(viewer->feed, data, one * count, &viewer->error);
    if (status == TETLOD_OK)
        status = refine(viewer);
    return status == TETLOD_OK || status == TETLOD_MORE ? one * count : 0;
}

int main(int argc, char **argv)
{
    struct viewer viewer = {0};
    char request[2048];
    if (argc != 3)
        return fprintf(stderr, "usage: refine URL ERROR\n"), 2;
    if (tetlod_feed_new(&viewer.feed, NULL, &viewer.error) != TETLOD_OK)
        return fprintf(stderr, "refine: %s\n", viewer.error.message), 1;
    CURL *curl = curl_easy_init();
    snprintf(request, sizeof request, "%s/prefix?error=%s", argv[1], argv[2]);
    curl_easy_setopt(curl, CURLOPT_URL, request);
    curl_easy_setopt(curl, CURLOPT_FAILONERROR, 1L);
    curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, arrive);
    curl_easy_setopt(curl, CURLOPT_WRITEDATA, &viewer);
    CURLcode done = curl_easy_perform(curl);
    curl_easy_cleanup(curl);
    if (done != CURLE_OK)
        fprintf(stderr, "refine: %s\n", viewer.error.message[0] ? viewer.error.message : curl_easy_strerror(done));
    tetlod_cursor_free(viewer.cursor);
    tetlod_feed_free(viewer.feed);
    return done != CURLE_OK;
}
