/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level FILE.tetlod ERROR: the coarsest level whose certified error is at most ERROR, and the volume of its mesh. Then
 * the same stream as a network client sees it: fed in pieces, with the finest level that each piece completes.
 *
 * cc level.c $(pkg-config --cflags --libs tetlod) -o level
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <tetlod.h>

static int fail(const struct tetlod_error *error)
{
    fprintf(stderr, "level: %s\n", error->message);
    return 1;
}

static double volume(const struct tetlod_mesh *mesh)
{
    double sum = 0;
    for (uint32_t t = 0; t < mesh->tets; t++) {
        const double *p[4], *o;
        double e[3][3];
        for (int c = 0; c < 4; c++)
            p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)t + (size_t)c];
        o = p[0];
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                e[k][i] = p[k + 1][i] - o[i];
        sum += fabs(e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] *
                    (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
                    e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) / 6;
    }
    return sum;
}

static int print_level(struct tetlod_file *file, double most, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;
    uint32_t level = tetlod_level_for_error(tetlod_info(file), most, TETLOD_NONE, TETLOD_MAX);
    if (level == TETLOD_NONE) {
        fprintf(stderr, "level: no level is within %g\n", most);
        return 1;
    }
    if (tetlod_cursor_new(&cursor, file, NULL, 0, error) != TETLOD_OK)
        return fail(error);
    int result = 0;
    if (tetlod_cursor_seek(cursor, level, error) == TETLOD_OK) {
        tetlod_cursor_mesh(cursor, &mesh);
        printf("level %u: %u vertices, %u tetrahedra, volume %.6g\n", mesh.level, mesh.vertices, mesh.tets,
               volume(&mesh));
    } else {
        result = fail(error);
    }
    tetlod_cursor_free(cursor);
    return result;
}

static int feed_file(FILE *in, struct tetlod_error *error)
{
    static char piece[16384];
    struct tetlod_feed *feed;
    uint32_t level = TETLOD_NONE;
    size_t size;
    if (tetlod_feed_new(&feed, NULL, error) != TETLOD_OK)
        return fail(error);
    while ((size = fread(piece, 1, sizeof piece, in)) > 0) {
        enum tetlod_status status = tetlod_feed_add(feed, piece, size, error);
        if (status != TETLOD_OK && status != TETLOD_MORE) {
            tetlod_feed_free(feed);
            return fail(error);
        }
        if (tetlod_feed_level(feed) != level)
            printf("level %u is there\n", level = tetlod_feed_level(feed));
    }
    tetlod_feed_free(feed);
    return 0;
}

int main(int argc, char **argv)
{
    struct tetlod_error error;
    struct tetlod_file *file;
    FILE *in = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (!in) {
        fprintf(stderr, "usage: level FILE.tetlod ERROR\n");
        return 2;
    }
    if (tetlod_open_fd(&file, fileno(in), NULL, &error) != TETLOD_OK)
        return fail(&error);
    int result = print_level(file, atof(argv[2]), &error);
    tetlod_close(file);
    if (!result)
        result = feed_file(in, &error);
    fclose(in);
    return result;
}
