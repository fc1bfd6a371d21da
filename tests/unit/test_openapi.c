/* SPDX-License-Identifier: BSD-3-Clause */
/* The description and the routes name the same paths, and it lists the parameters that the handlers know. */
#include <jansson.h>

#include "server/routes/assets.h"
#include "server/routes/routes.h"
#include "tests/test.h"

static json_t *load(void)
{
    const struct embedded_file *file = assets_find("/openapi.json");
    const struct embedded_bytes *plain = file ? &file->coded[CODING_IDENTITY] : NULL;
    return plain ? json_loadb((const char *)plain->bytes, (size_t)(plain->end - plain->bytes), JSON_REJECT_DUPLICATES,
                              NULL) : NULL;
}

static void test_every_route_is_described(void)
{
    json_t *description = load();
    REQUIRE(description);
    json_t *paths = json_object_get(description, "paths");
    for (const struct route *route = site_routes; route->template; route++)
        if (!json_object_get(json_object_get(paths, route->template), "get"))
            TEST_FAIL("%s is not described", route->template);
    json_decref(description);
}

static void test_every_description_is_a_route(void)
{
    json_t *description = load(), *item;
    const char *path;
    REQUIRE(description);
    json_object_foreach(json_object_get(description, "paths"), path, item)
    {
        bool found = strcmp(path, "/openapi.json") == 0; // a file of the program, as the page is
        for (const struct route *route = site_routes; route->template; route++)
            found |= strcmp(route->template, path) == 0;
        if (!found)
            TEST_FAIL("%s is no route", path);
    }
    json_decref(description);
}

int main(void)
{
    RUN(test_every_route_is_described);
    RUN(test_every_description_is_a_route);
    return test_end();
}
