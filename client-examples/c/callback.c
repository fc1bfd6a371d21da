/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * callback URL ERROR [HEADER]...: reads a stream on any web host through a callback that fetches bytes by Range, as a
 * program with a storage of its own would. Only the bytes of the level are fetched. The URL may have a query, such as a
 * signature; headers ("Authorization: Bearer ...") go with every request.
 *
 * cc callback.c $(pkg-config --cflags --libs tetlod libcurl) -lm -o callback
 * ./callback https://example.org/data/fin.tetlod 0.01
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <curl/curl.h>
#include <tetlod.h>

struct remote {
    CURL *curl;
    unsigned char *out; /* where the answer goes */
    size_t room, requests, bytes;
};

static size_t take(char *data, size_t one, size_t count, void *opaque)
{
    struct remote *remote = opaque;
    if (one * count > remote->room)
        return 0; /* the host does not answer Range requests */
    memcpy(remote->out, data, one * count);
    remote->out += one * count;
    remote->room -= one * count;
    return one * count;
}

static enum tetlod_status read_range(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    struct remote *remote = opaque;
    char range[64];
    if (size == 0)
        return TETLOD_OK;
    snprintf(range, sizeof range, "%llu-%llu", (unsigned long long)offset, (unsigned long long)(offset + size - 1));
    remote->out = buffer;
    remote->room = size;
    remote->requests++;
    remote->bytes += size;
    curl_easy_setopt(remote->curl, CURLOPT_RANGE, range);
    return curl_easy_perform(remote->curl) == CURLE_OK && remote->room == 0 ? TETLOD_OK : TETLOD_ERR_IO;
}

/* Bytes 32 to 39 of a stream are its size (SPEC 2). */
static enum tetlod_status size_of(struct remote *remote, uint64_t *size)
{
    unsigned char header[40];
    *size = 0;
    enum tetlod_status status = read_range(remote, 0, header, sizeof header);
    for (int i = 0; i < 8 && status == TETLOD_OK; i++)
        *size |= (uint64_t)header[32 + i] << (8 * i);
    return status;
}

int main(int argc, char **argv)
{
    if (argc < 3)
        return fprintf(stderr, "usage: callback URL ERROR [HEADER]...\n"), 2;
    struct curl_slist *headers = NULL;
    struct remote remote = {.curl = curl_easy_init()};
    struct tetlod_source source = {.read = read_range, .opaque = &remote};
    struct tetlod_error error = {0};
    struct tetlod_file *file = NULL;
    struct tetlod_cursor *cursor = NULL;
    struct tetlod_mesh mesh;
    curl_easy_setopt(remote.curl, CURLOPT_URL, argv[1]);
    for (int i = 3; i < argc; i++)
        headers = curl_slist_append(headers, argv[i]);
    curl_easy_setopt(remote.curl, CURLOPT_HTTPHEADER, headers);
    curl_easy_setopt(remote.curl, CURLOPT_FAILONERROR, 1L);
    curl_easy_setopt(remote.curl, CURLOPT_WRITEFUNCTION, take);
    curl_easy_setopt(remote.curl, CURLOPT_WRITEDATA, &remote);
    int good = size_of(&remote, &source.size) == TETLOD_OK && tetlod_open(&file, &source, NULL, &error) == TETLOD_OK;
    uint32_t level = good ? tetlod_level_for_error(tetlod_info(file), strtod(argv[2], NULL), TETLOD_NONE,
                                                   TETLOD_MAX) : TETLOD_NONE;
    good = level != TETLOD_NONE && tetlod_cursor_new(&cursor, file, NULL, 0, &error) == TETLOD_OK &&
           tetlod_cursor_seek(cursor, level, &error) == TETLOD_OK;
    if (good) {
        tetlod_cursor_mesh(cursor, &mesh);
        printf("level %u: %u vertices, %u tetrahedra, %zu bytes in %zu requests\n", mesh.level, mesh.vertices,
               mesh.tets, remote.bytes,
               remote.requests);
    } else {
        fprintf(stderr, "callback: %s\n",
                error.message[0] ? error.message : "no answer, or no level within that error");
    }
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    curl_easy_cleanup(remote.curl);
    curl_slist_free_all(headers);
    return !good;
}
