# SPDX-License-Identifier: BSD-3-Clause
# Varnish 7 in front of several tetlod: a cache in memory and failover. Ranges are answered from what is cached. TLS: hitch or
# nginx before it. It says whom it asks for (X-Forwarded-For), which `--trust-proxy 127.0.0.1` lets a server believe.
vcl 4.1;

import directors;

probe ready {
    .url = "/readyz";
    .interval = 1s;
    .timeout = 1s;
    .window = 3;
    .threshold = 2;
    .initial = 2;
}

backend one {
    .host = "127.0.0.1";
    .port = "8081";
    .probe = ready;
    .connect_timeout = 1s;
}

backend two {
    .host = "127.0.0.1";
    .port = "8082";
    .probe = ready;
    .connect_timeout = 1s;
}

sub vcl_init {
    new tetlod = directors.round_robin();
    tetlod.add_backend(one);
    tetlod.add_backend(two);
}

sub vcl_recv {
    set req.backend_hint = tetlod.backend();
    if (req.method == "OPTIONS") {
        return (pass);
    }
    if (req.method != "GET" && req.method != "HEAD") {
        return (synth(405));
    }
    if (req.url == "/metrics") {
        return (synth(404));
    }
    # Who brings a token (--token) gets answers that are for them alone.
    if (req.http.Authorization || req.http.Cookie ~ "(^|;\s*)tetlod_token_") {
        return (pass);
    }
    unset req.http.Cookie;
    return (hash);
}

# A server that is gone is another one's request: all of them give the same answers.
sub vcl_backend_response {
    if (beresp.status >= 500 && bereq.retries < 2) {
        return (retry);
    }
    if (bereq.url ~ "^/v1/meshes/[^/]+/[0-9a-f]{32}/" && beresp.status == 200 &&
        beresp.http.Cache-Control !~ "(?i)private|no-store") {
        set beresp.ttl = 365d;
        set beresp.grace = 1d;
        set beresp.do_stream = true;
        return (deliver);
    }
    set beresp.uncacheable = true;
    set beresp.ttl = 0s;
    return (deliver);
}

sub vcl_backend_fetch {
    set bereq.http.Host = "localhost"; # on loopback a server answers to this machine's names alone (--host)
    if (bereq.retries > 0) {
        set bereq.backend = tetlod.backend();
    }
}

sub vcl_backend_error {
    if (bereq.retries < 2) {
        return (retry);
    }
}
