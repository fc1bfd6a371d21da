/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/net/proxies.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/number_text.h"

/* An address of IPv4 is one of IPv6, as in ::ffff:1.2.3.4. */
struct network {
    struct in6_addr address;
    unsigned bits;
};

struct proxies {
    struct network *networks;
    size_t count;
    bool unix_sockets;
};

/* Reads an address; `out_bits`: how many bits it has as one of IPv6 before its own begin. */
static bool read_address(const char *text, struct in6_addr *out, unsigned *out_bits)
{
    static const unsigned char mapped[12] = {[10] = 0xff, 0xff};
    struct in_addr four;
    *out_bits = 0;
    if (inet_pton(AF_INET6, text, out) == 1)
        return true;
    if (inet_pton(AF_INET, text, &four) != 1)
        return false;
    memcpy(out->s6_addr, mapped, sizeof mapped);
    memcpy(out->s6_addr + sizeof mapped, &four, sizeof four);
    *out_bits = 8 * sizeof mapped;
    return true;
}

static bool read_network(const char *text, struct network *out)
{
    char address[INET6_ADDRSTRLEN];
    unsigned before;
    uint64_t bits;
    size_t size = strcspn(text, "/");
    if (size >= sizeof address)
        return false;
    memcpy(address, text, size);
    address[size] = 0;
    if (!read_address(address, &out->address, &before))
        return false;
    out->bits = 128;
    if (!text[size])
        return true;
    if (!text_count(text + size + 1, false, &bits) || bits > 128 - before)
        return false;
    out->bits = before + (unsigned)bits;
    return true;
}

static bool has(const struct network *network, const struct in6_addr *address)
{
    unsigned whole = network->bits / 8, rest = network->bits % 8;
    if (memcmp(network->address.s6_addr, address->s6_addr, whole) != 0)
        return false;
    return !rest || !((network->address.s6_addr[whole] ^ address->s6_addr[whole]) >> (8 - rest));
}

enum tetlod_status proxies_new(struct proxies **out, const char *const *list, size_t count, struct tetlod_error *error)
{
    struct proxies *proxies = *out = array_zero(1, sizeof *proxies);
    if (!proxies || !(proxies->networks = array_zero(count, sizeof *proxies->networks)))
        return tetlodi_fail_nomem(error, "the server", count);
    for (size_t i = 0; i < count; i++) {
        if (strcmp(list[i], "unix") == 0)
            proxies->unix_sockets = true;
        else if (!read_network(list[i], &proxies->networks[proxies->count++]))
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                "'%.120s' is no proxy: give an address, ADDRESS/BITS, or unix", list[i]);
    }
    return TETLOD_OK;
}

void proxies_free(struct proxies *proxies)
{
    if (proxies)
        free(proxies->networks);
    free(proxies);
}

bool proxies_trust(const struct proxies *proxies, const char *text)
{
    struct in6_addr address;
    unsigned before;
    if (strcmp(text, "unix") == 0)
        return proxies->unix_sockets;
    if (!read_address(text, &address, &before))
        return false;
    for (size_t i = 0; i < proxies->count; i++)
        if (has(&proxies->networks[i], &address))
            return true;
    return false;
}

/* One element of the list, without brackets and port ("1.2.3.4:80", "[::1]:80"). */
static bool read_element(const char *text, size_t size, char out[static INET6_ADDRSTRLEN])
{
    struct in6_addr address;
    unsigned before;
    while (size && strchr(" \t", *text)) {
        text++;
        size--;
    }
    if (size && *text == '[') {
        const char *end = memchr(text, ']', size);
        text++;
        size = end ? (size_t)(end - text) : 0;
    } else {
        const char *colon = memchr(text, ':', size);
        if (colon && !memchr(colon + 1, ':', (size_t)(text + size - colon - 1)))
            size = (size_t)(colon - text);
    }
    while (size && strchr(" \t", text[size - 1]))
        size--;
    if (!size || size >= INET6_ADDRSTRLEN)
        return false;
    memcpy(out, text, size);
    out[size] = 0;
    return read_address(out, &address, &before);
}

bool proxies_client(const struct proxies *proxies, const char *forwarded, char out[static INET6_ADDRSTRLEN])
{
    size_t end = strlen(forwarded);
    bool found = false;
    while (end) {
        size_t begin = end;
        char one[INET6_ADDRSTRLEN];
        while (begin && forwarded[begin - 1] != ',')
            begin--;
        if (!read_element(forwarded + begin, end - begin, one))
            break;
        memcpy(out, one, sizeof one);
        found = true;
        if (!proxies_trust(proxies, one))
            break;
        end = begin ? begin - 1 : 0;
    }
    return found;
}

void network_of(const char *address, char out[static INET6_ADDRSTRLEN])
{
    struct in6_addr six;
    snprintf(out, INET6_ADDRSTRLEN, "%s", address);
    if (inet_pton(AF_INET6, address, &six) != 1 || IN6_IS_ADDR_V4MAPPED(&six))
        return;
    memset(six.s6_addr + 8, 0, 8);
    inet_ntop(AF_INET6, &six, out, INET6_ADDRSTRLEN);
}
