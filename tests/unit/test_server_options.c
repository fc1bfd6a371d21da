/* SPDX-License-Identifier: BSD-3-Clause */
/* A server copies the texts of its options: here they are gone when it runs. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/server.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { MAX_TEXTS = 16 };

static char *texts[MAX_TEXTS];
static size_t text_count;

/* A copy that is written over and freed by lose_texts. */
static const char *passing(const char *text)
{
    return texts[text_count++] = strdup(text);
}

static void lose_texts(void)
{
    while (text_count) {
        char *text = texts[--text_count];
        memset(text, '!', strlen(text));
        free(text);
    }
}

/* The whole answer to a request line and headers, on a connection of its own. */
static void ask(unsigned port, const char *lines, char *out, size_t capacity)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    char request[512];
    size_t used = 0;
    ssize_t got = 1;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    int size = snprintf(request, sizeof request, "%s\r\nConnection: close\r\n\r\n", lines);
    out[0] = 0;
    CHECK(connect(fd, (struct sockaddr *)&address, sizeof address) == 0 && send(fd, request, (size_t)size, 0) == size);
    for (; got > 0 && used + 1 < capacity; used += got > 0 ? (size_t)got : 0)
        got = recv(fd, out + used, capacity - used - 1, 0);
    out[used] = 0;
    close(fd);
}

static void test_texts_are_copied(void)
{
    char folder[] = "/tmp/tetlod-options-XXXXXX", path[64], token[64], answer[20000];
    REQUIRE(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/m.tetlod", folder);
    snprintf(token, sizeof token, "%s/token", folder);
    const struct gen_options made = {.kind = GEN_GRID, .seed = 1, .size = 2, .levels = 4, .arity = 2,
                                     .type = TETLOD_FLOAT32};
    FILE *file = fopen(token, "w");
    REQUIRE(gen_write(path, &made) && file && fputs("secret", file) >= 0 && fclose(file) == 0);
    const char *listen[] = {passing("127.0.0.1:0")}, *paths[] = {passing(folder)};
    const char *cors[] = {passing("https://a.example")}, *proxies[] = {passing("127.0.0.1")};
    const char *hosts[] = {passing("h.example")}, *origins[] = {passing("https://data.example")};
    const struct server_options options = {
        .listen = listen, .listen_count = 1, .metrics = passing("127.0.0.1:0"), .paths = paths, .path_count = 1,
        .cors = cors, .cors_count = 1, .hosts = hosts, .host_count = 1, .token_file = passing(token),
        .proxies = proxies, .proxy_count = 1, .base_path = passing("/x/"), .stream_origins = origins,
        .stream_origin_count = 1, .threads = 1, .scan_seconds = 0.02,
    };
    struct server *server;
    struct tetlod_error error;
    REQUIRE(server_start(&server, &options, &error) == TETLOD_OK);
    lose_texts();
    unsigned port = 0;
    const char *url = server_url(server, 0);
    CHECK(sscanf(url, "http://127.0.0.1:%u", &port) == 1 && strcmp(url + strlen(url) - 3, "/x/") == 0);
    ask(port, "GET /x/v1/meshes/m HTTP/1.1\r\nHost: h.example\r\nAuthorization: Bearer secret\r\n"
              "Origin: https://a.example\r\nX-Forwarded-For: 1.2.3.4", answer, sizeof answer);
    CHECK(strncmp(answer, "HTTP/1.1 200", 12) == 0);
    CHECK(strstr(answer, "Access-Control-Allow-Origin: https://a.example\r\n") != NULL);
    ask(port, "GET /x HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer secret", answer, sizeof answer);
    CHECK(strncmp(answer, "HTTP/1.1 308", 12) == 0);
    ask(port, "GET /x/?token=secret HTTP/1.1\r\nHost: localhost", answer, sizeof answer);
    CHECK(strstr(answer, "; Path=/x/;") != NULL);
    ask(port, "GET /x/view/m HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer secret", answer, sizeof answer);
    CHECK(strstr(answer, " https://data.example") != NULL || strncmp(answer, "HTTP/1.1 404", 12) == 0); // WEB=0
    unlink(path); // the folder is looked at again
    server_rescan(server);
    do
        ask(port, "GET /x/v1/meshes/m HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer secret", answer,
            sizeof answer);
    while (strncmp(answer, "HTTP/1.1 200", 12) == 0);
    CHECK(strncmp(answer, "HTTP/1.1 404", 12) == 0);
    CHECK(server_stop(server));
    unlink(token);
    rmdir(folder);
}

int main(void)
{
    RUN(test_texts_are_copied);
    return test_end();
}
