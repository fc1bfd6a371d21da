/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fetch URL ERROR [HEADER]...: the level of a tetlod server's mesh at ERROR, a fraction of the range, in one request.
 * The URL's own query, such as a signature, and the headers ("Authorization: Bearer ...") go along.
 *
 * cc fetch.c $(pkg-config --cflags --libs tetlod libcurl) -lm -o fetch
 * ./fetch http://127.0.0.1:8080/v1/meshes/fin 0.01
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <curl/curl.h>
#include <tetlod.h>

struct bytes {
    char *data;
    size_t size;
};

static size_t append(char *data, size_t one, size_t count, void *opaque)
{
    struct bytes *bytes = opaque;
    char *grown = realloc(bytes->data, bytes->size + one * count);
    if (!grown)
        return 0;
    bytes->data = grown;
    memcpy(bytes->data + bytes->size, data, one * count);
    bytes->size += one * count;
    return one * count;
}

static int fetch(const char *url, const char *limit, struct curl_slist *headers, struct bytes *bytes)
{
    char request[2048];
    CURL *curl = curl_easy_init();
    const size_t path = strcspn(url, "?");
    snprintf(request, sizeof request, "%.*s/prefix?error=%s%s%s", (int)path, url, limit, url[path] ? "&" : "",
             url[path] ? url + path + 1 : "");
    curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
    curl_easy_setopt(curl, CURLOPT_URL, request);
    curl_easy_setopt(curl, CURLOPT_FAILONERROR, 1L);
    curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, append);
    curl_easy_setopt(curl, CURLOPT_WRITEDATA, bytes);
    CURLcode done = curl_easy_perform(curl);
    curl_easy_cleanup(curl);
    if (done != CURLE_OK)
        fprintf(stderr, "fetch: %s: %s\n", request, curl_easy_strerror(done));
    return done == CURLE_OK;
}

/* The largest value of the first field, to show where values are. */
static double largest(const struct tetlod_mesh *mesh, const struct tetlod_field *field)
{
    double most = mesh->fields[0][0];
    for (size_t i = 0; i < (size_t)mesh->vertices * field->components; i++)
        most = mesh->fields[0][i] > most ? mesh->fields[0][i] : most;
    return most;
}

int main(int argc, char **argv)
{
    struct bytes bytes = {0};
    struct tetlod_error error = {0};
    struct tetlod_file *file = NULL;
    struct tetlod_cursor *cursor = NULL;
    struct tetlod_mesh mesh;
    struct curl_slist *headers = NULL;
    if (argc < 3)
        return fprintf(stderr, "usage: fetch URL ERROR [HEADER]...\n"), 2;
    for (int i = 3; i < argc; i++)
        headers = curl_slist_append(headers, argv[i]);
    int fetched = fetch(argv[1], argv[2], headers, &bytes);
    curl_slist_free_all(headers);
    if (!fetched)
        return 1;
    int good = tetlod_open_memory(&file, bytes.data, bytes.size, NULL, &error) == TETLOD_OK &&
               tetlod_cursor_new(&cursor, file, NULL, 0, &error) == TETLOD_OK &&
               tetlod_cursor_seek(cursor, tetlod_level_for_bytes(tetlod_info(file), bytes.size), &error) == TETLOD_OK;
    if (good) {
        tetlod_cursor_mesh(cursor, &mesh);
        printf("level %u: %u vertices, %u tetrahedra, from %zu bytes\n", mesh.level, mesh.vertices, mesh.tets,
               bytes.size);
        if (tetlod_info(file)->field_count)
            printf("%s is at most %g\n", tetlod_info(file)->fields[0].name,
                   largest(&mesh, &tetlod_info(file)->fields[0]));
    } else {
        fprintf(stderr, "fetch: %s\n", error.message);
    }
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    free(bytes.data);
    return !good;
}
