# SPDX-License-Identifier: BSD-3-Clause
# tetlod: everything is built, tested, measured and installed from here. `make help` lists the targets.

config ?= release
CC ?= cc
PKG_CONFIG ?= pkg-config
PREFIX ?= /usr/local
bindir ?= $(PREFIX)/bin
libdir ?= $(PREFIX)/lib
includedir ?= $(PREFIX)/include
docdir ?= $(PREFIX)/share/doc/tetlod
mandir ?= $(PREFIX)/share/man
completionsdir ?= $(PREFIX)/share/bash-completion/completions
unitdir ?= $(PREFIX)/lib/systemd/system
INSTALL ?= install
OBJCOPY ?= objcopy
-include config.mk

VERSION := $(shell sed -n 's/^.define TETLOD_VERSION_STRING "\(.*\)"/\1/p' format/tetlod.h)
SOVERSION := $(firstword $(subst ., ,$(VERSION)))
B := build/$(config)
# What demo and check build uses every core, unless the caller has said how many (-jN)
PARALLEL = $(if $(findstring -j,$(MAKEFLAGS)),,-j$(shell nproc 2>/dev/null || echo 2))

# ---- what a build asks for. `make needs` looks for it on any system; `make deps` installs it, on Debian alone
NEEDS_COMMANDS = $(CC) $(AR) $(LD) $(OBJCOPY) $(PKG_CONFIG) python3 $(if $(ALONE),,zstd) $(if $(filter \
    0,$(WEB))$(ALONE)$(PREBUILT),,node npm $(WASM_CC))
NEEDS_CHECK := clang mypy gmsh adf2hdf qemu-ppc nginx varnishd openssl chromium-headless-shell lintian dh
NEEDS_PYTHON := numpy scipy vtk meshio h5py netCDF4 jsonschema nbconvert setuptools wheel pip venv
# Debian packages of all that
DEPS_BUILD := gcc libc6-dev make pkg-config ca-certificates curl python3 zstd libzstd-dev libexpat1-dev zlib1g-dev \
    liblz4-dev liblzma-dev libhdf5-dev libnetcdf-dev libcgns-dev libcurl4-openssl-dev \
    libjansson-dev libmicrohttpd-dev clang-14 lld-14 wasi-libc libclang-rt-14-dev-wasm32 \
    $(foreach command,node npm,$(if $(shell command -v $(command)),,$(command:node=nodejs)))
# For `make mpi`
DEPS_MPI := mpi-default-dev mpi-default-bin
# For client-examples/python/insitu_dolfinx.py: 340 MB, so no check asks for them
DEPS_INSITU := python3-dolfinx python3-mpi4py
DEPS_CHECK := lintian debhelper clang python3-venv python3-pip python3-setuptools python3-wheel mypy qemu-user \
    gcc-powerpc-linux-gnu libc6-dev-powerpc-cross libclang-rt-14-dev python3-numpy python3-scipy python3-vtk9 \
    python3-meshio python3-h5py python3-xarray python3-netcdf4 gmsh cgns-convert python3-jsonschema python3-nbconvert \
    nginx-light varnish openssl chromium-headless-shell firefox-esr xvfb cmake g++ libvtk9-dev $(DEPS_MPI) parallel \
    slurmd slurmctld slurm-client python3-distributed
DEPS_BENCH := python3-vtk9 wrk nginx-light chromium-headless-shell
# For `make vtk` and `make paraview`: VTK takes 380 MB, ParaView 970 MB, so no check asks for the latter
DEPS_VTK := cmake g++ python3-vtk9 libvtk9-dev paraview-dev libcurl4-openssl-dev

# ---- flags: ours first, the user's CPPFLAGS, CFLAGS, LDFLAGS appended
# SERVER=0 builds the program without `serve` and `explode`: neither libmicrohttpd nor the page is asked for
SERVER ?= 1
PACKAGES := libzstd expat zlib liblz4 liblzma jansson $(if $(filter 0,$(SERVER)),,libmicrohttpd)
REQUIRED := $(PACKAGES)
# Libraries of single formats, and libcurl for URLs: used where they are installed; HDF5=0 and so on leave one out
# (What is missing is said once, by look_for_needs: here nothing complains)
# Debian's hdf5 may be the one for MPI, which brings MPI along; the serial one is NetCDF's and CGNS's anyway
HDF5_PACKAGE := $(firstword $(foreach package,hdf5-serial hdf5,$(shell $(PKG_CONFIG) --exists $(package) 2>/dev/null \
    && echo $(package))))
HDF5 ?= $(if $(HDF5_PACKAGE),1)
NETCDF ?= $(shell $(PKG_CONFIG) --exists netcdf 2>/dev/null && echo 1)
HDF5 := $(HDF5)
NETCDF := $(NETCDF)
CURL ?= $(shell $(PKG_CONFIG) --exists libcurl 2>/dev/null && echo 1)
CURL := $(CURL)
CGNS ?= $(if $(wildcard $(addsuffix /cgnslib.h,/usr/include /usr/local/include)),1)
PACKAGES += $(if $(filter 1,$(HDF5)),$(HDF5_PACKAGE)) $(if $(filter 1,$(NETCDF)),netcdf) \
    $(if $(filter 1,$(CURL)),libcurl)
OPTIONAL_CFLAGS := $(if $(filter 1,$(HDF5)),-DTETLOD_HDF5) $(if $(filter 1,$(NETCDF)),-DTETLOD_NETCDF) $(if $(filter \
    1,$(CGNS)),-DTETLOD_CGNS) $(if $(filter 1,$(CURL)),-DTETLOD_CURL)
OPTIONAL_SRC := $(if $(filter 1,$(HDF5)),,src/io/services/h5.c src/io/readers/vtkhdf.c src/io/readers/xdmf.c \
    src/io/readers/xdmf_item.c \
    src/io/writers/vtkhdf_write.c src/io/writers/vtkhdf_stream.c) \
    $(if $(filter 1,$(NETCDF)),,src/io/readers/exodus.c) $(if $(filter 1,$(CGNS)),,src/io/readers/cgns.c)
WARNINGS := -Wall -Wextra -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wvla -Wundef -Wcast-qual -Wpointer-arith \
    -Wwrite-strings
ifeq ($(werror),1)
WARNINGS += -Werror
endif
# -ffp-contract=off: a fused multiply-add would make levels and streams differ between machines
# Traces of the sanitizers need lines alone: a quarter less to compile and to link
DEBUG_INFO := $(if $(filter asan tsan,$(config)),-g1,-g)
TETLOD_CFLAGS := -std=c11 -I. -D_POSIX_C_SOURCE=200809L -pthread -fPIC -fvisibility=hidden -ffp-contract=off \
    $(DEBUG_INFO) $(WARNINGS)
TETLOD_LDFLAGS := -pthread
PLACE :=
FUZZER :=
ifeq ($(config),release)
# GCC 12 forgets a rounding to float and back where it vectorises such lines together (three coordinates of a point)
# Hardened: what overruns a buffer ends the program, and nothing can be written over that calls go through
TETLOD_CFLAGS += -O3 -fno-tree-slp-vectorize -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -fstack-protector-strong
TETLOD_LDFLAGS += -Wl,-z,relro,-z,now
else ifeq ($(config),debug)
TETLOD_CFLAGS += -O0 -DTETLOD_DEBUG
else ifeq ($(config),asan)
# What is undefined traps (ASAN_OPTIONS=handle_sigill=1 says where): what could be said of 100,000 places would be most
# of a program, whose addresses each start would move if it were not at a fixed place
TETLOD_CFLAGS += -O1 -fno-omit-frame-pointer -fsanitize=address,undefined -fsanitize-undefined-trap-on-error
TETLOD_LDFLAGS += -fsanitize=address,undefined
PLACE := -no-pie
else ifeq ($(config),tsan)
TETLOD_CFLAGS += -O1 -fsanitize=thread
TETLOD_LDFLAGS += -fsanitize=thread
else ifeq ($(config),coverage)
TETLOD_CFLAGS += -O0 --coverage
TETLOD_LDFLAGS += --coverage
else ifeq ($(config),fuzz)
CC := clang
TETLOD_CFLAGS += -O1 -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all
TETLOD_LDFLAGS += -fsanitize=address,undefined
FUZZER := -fsanitize=fuzzer
else
$(error config is one of release, debug, asan, tsan, coverage, fuzz, not '$(config)')
endif
PACKAGE_CFLAGS := $(shell $(PKG_CONFIG) --cflags $(PACKAGES) 2>/dev/null) $(OPTIONAL_CFLAGS)
PACKAGE_LIBS := $(shell $(PKG_CONFIG) --libs $(PACKAGES) 2>/dev/null) $(if $(filter 1,$(CGNS)),-lcgns) -lm

# ---- sources and what is made of them
FORMAT_SRC := $(sort $(wildcard format/*.c format/*/*.c))
# What no reader of levels needs: what writes, and what only this program asks of a stream
WRITING := $(wildcard format/write/*.c) $(patsubst %,format/read/%.c,exact_values grids parts summary box_sums)
LIBRARY_SRC := $(sort $(filter-out src/cli/% src/mpi/% $(OPTIONAL_SRC),$(wildcard src/*/*.c src/*/*/*.c)))
# What builds a stream out of arrays: libtetlod-build
BUILD_SRC := $(filter src/library/% src/pipeline/% src/simplify/% src/cells/% src/log/% src/measure/% \
    src/stream/forest.c src/stream/region.c src/mesh/% src/util/% src/ask/features.c src/ask/clip.c,$(LIBRARY_SRC))
CLI_SRC := $(sort $(wildcard src/cli/*.c))
SERVER_SRC := $(sort $(wildcard server/*.c server/net/*.c server/http/*.c server/jobs/*.c server/routes/*.c \
    server/store/*.c))
ALONE := $(if $(filter 0,$(SERVER)),-alone)
SUPPORT_SRC := $(sort $(wildcard tests/*.c))
UNIT_SRC := $(sort $(wildcard tests/unit/test_*.c))
FUZZ_SRC := $(sort $(wildcard tests/fuzz/fuzz_*.c))
objects = $(patsubst %.c,$(B)/%.o,$(1))
OBJECTS := $(call objects,$(FORMAT_SRC) $(LIBRARY_SRC) $(CLI_SRC) $(SERVER_SRC) $(SUPPORT_SRC) $(UNIT_SRC) $(FUZZ_SRC) \
    tests/fuzz/rerun.c)
LIBTETLOD := $(B)/libtetlod.a
SHARED := $(B)/libtetlod.so.$(VERSION)
LIBBUILD := $(B)/libtetlod-build.a
SHARED_BUILD := $(B)/libtetlod-build.so.$(VERSION)
# The page and what it loads, bundled by esbuild, become part of the program
WEB_DIR := server/web
WEB_SRC := $(sort $(shell find $(WEB_DIR) -name node_modules -prune -o -type f -print))
# `make dist` puts the page and the package in here, so that what is built from it needs neither npm nor a network
PREBUILT := $(wildcard $(WEB_DIR)/prebuilt)
WEB_OUT := $(if $(PREBUILT),$(PREBUILT)/page,build/web)
WEB_STAMP := $(if $(PREBUILT),$(PREBUILT),build/web.stamp)
# WEB=0 builds the server without the page, and no package for the web: neither npm nor a network is asked for
WEB ?= 1
# The codec and its geometry as WebAssembly, for the page and for clients of their own: package of ES modules in
# build/client
WASM_CC ?= $(firstword $(foreach c,clang-14 clang,$(if $(shell command -v $(c)),$(c))) clang)
# as fast as -O3 within a twentieth, measured, and a fifth smaller
WASM_CFLAGS := --target=wasm32-wasi -mexec-model=reactor -mbulk-memory -msimd128 -mnontrapping-fptoint \
    -ftls-model=local-exec -std=c11 -O2 -mllvm -inline-threshold=40 -fno-unroll-loops -fno-vectorize -ffp-contract=off \
    -DTETLODI_DECODES_ONLY -I. -Dsnprintf=view_snprintf -Dvsnprintf=view_vsnprintf -D_POSIX_C_SOURCE=200809L \
    $(WARNINGS) -Wframe-larger-than=131072 -Werror=frame-larger-than # of a stack of 262144
WASM_LDFLAGS := -Wl,--strip-all -Wl,--max-memory=4294967296 -Wl,-z,stack-size=262144
CUT_SRC := $(sort $(wildcard src/cut/*.c)) $(patsubst %,src/mesh/%.c,adjacency hilbert tetmesh) src/util/array.c
WASM_SRC := $(sort $(wildcard $(WEB_DIR)/wasm/*.c)) $(filter-out $(WRITING),$(FORMAT_SRC)) $(CUT_SRC)
# of these bytes count more than time, or no time is lost
WASM_SMALL := $(patsubst %,$(WEB_DIR)/wasm/%.c,describe fine lengths pictures print view view_cells view_adopt \
    view_filter view_function view_solid view_steps) \
    src/cut/cut_solid.c src/cut/line.c src/cut/normals.c src/cut/rays.c src/cut/voxels.c src/mesh/hilbert.c \
    src/mesh/tetmesh.c src/util/array.c format/common/arithmetic.c \
    $(patsubst %,format/coding/%.c,base cell_steps cells header index page_decode page_table pointer section \
    star_view step_code tail time_table topologies) \
    $(filter-out $(WRITING),$(wildcard format/read/*.c)) \
    $(patsubst %,format/common/%.c,bytes checksum memory pack) format/status.c
WASM := build/wasm/tetlod.wasm
# what makes a level that is finer in boxes, and answers with a proof: loaded when it is first wanted
REFINE_SRC := $(wildcard $(WEB_DIR)/refine/*.c) $(WEB_DIR)/wasm/print.c $(filter-out $(WRITING),$(FORMAT_SRC)) \
    src/stream/forest.c src/stream/region.c src/mesh/mixed_cells.c src/mesh/tetmesh.c src/util/array.c src/util/room.c \
    $(filter-out %/quadrature.c,$(wildcard src/ask/*.c)) $(patsubst %,format/read/%.c,summary box_sums) \
    src/cut/line.c $(patsubst %,src/mesh/%.c,adjacency hilbert locate) \
    $(patsubst %,src/stream/%.c,selection series_time) $(patsubst %,src/util/%.c,number_text)
REFINE := build/wasm/refine.wasm
CLIENT := build/client
# The widget of notebooks, one module, which the Python package brings along
WIDGET := $(if $(PREBUILT),$(PREBUILT)/widget.js,build/widget.js)
VALIDATE := build/validate.html
CLIENT_SRC := $(sort $(wildcard $(WEB_DIR)/client/*.js)) $(wildcard client-examples/web/*)
NODE_MODULES := $(WEB_DIR)/node_modules/.package-lock.json
EMBEDDED := $(if $(ALONE),,$(B)/server/embedded$(if $(filter 0,$(WEB)),-api).o)
EMBEDDED_SRC := build/$(if $(filter 0,$(WEB)),embedded-api,embedded)/embedded.c
INTERNAL := $(call objects,$(LIBRARY_SRC) $(if $(ALONE),,$(SERVER_SRC))) $(EMBEDDED)
BINARY := $(B)/tetlod$(ALONE)
# The same as an archive that holds no copies: a test is linked with what it calls
INTERNAL_ARCHIVE := $(B)/internal.a
UNIT_TESTS := $(patsubst tests/unit/%.c,$(B)/tests/unit/%,$(UNIT_SRC))
FUZZ_TARGETS := $(patsubst tests/fuzz/%.c,$(B)/tests/fuzz/%,$(FUZZ_SRC))

.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.SECONDARY:
Q := $(if $(V),,@)

## all: the program, the libraries and the package of the web client (WEB=0: without the page and the package, needs no
##   npm; SERVER=0: without the server; config=release|debug|asan|tsan|coverage|fuzz)
.PHONY: all
all: $(BINARY) $(LIBTETLOD) $(SHARED) $(LIBBUILD) $(SHARED_BUILD) $(if $(filter \
    0,$(WEB))$(ALONE)$(PREBUILT),,$(CLIENT)/package.json $(WIDGET) $(VALIDATE))

# A change of flags rebuilds: the stamp holds the line that compiles.
FLAGS_LINE = $(CC) $(TETLOD_CFLAGS) $(OPTIONAL_CFLAGS) $(HDF5_PACKAGE) $(CPPFLAGS) $(CFLAGS) $(TETLOD_LDFLAGS) \
    $(LDFLAGS)
$(B)/flags: FORCE
	@mkdir -p $(@D); \
	    echo '$(FLAGS_LINE)' | cmp -s - $@ || { $(look_for_needs) [ -z "$$missing" ] || { $(say_needs); exit 1; }; \
	    echo '$(FLAGS_LINE)' > $@; }
.PHONY: FORCE
FORCE:

# The commands of a program without the server
$(B)/src/cli/main-alone.o: private CPPFLAGS += -DTETLOD_NO_SERVER
$(B)/src/cli/main-alone.o: src/cli/main.c $(B)/flags
	$(Q)$(CC) $(TETLOD_CFLAGS) $(CPPFLAGS) $(CFLAGS) -MMD -MP -c -o $@ $<
CLI_OBJECTS := $(if $(ALONE),$(call objects,$(filter-out %/main.c %/cmd_serve.c %/serve_request.c %/cmd_explode.c \
    %/explode.c,$(CLI_SRC))) $(B)/src/cli/main-alone.o,$(call objects,$(CLI_SRC)))
OBJECTS += $(B)/src/cli/main-alone.o

# The same arithmetic for processors that have it; the program asks which it runs on.
$(B)/src/simplify/mesh/kernels_avx2.o: private TETLOD_CFLAGS += $(if $(filter x86_64%,$(shell $(CC) -dumpmachine \
    2>/dev/null)),-mavx2)

$(B)/%.o: %.c $(B)/flags
	@mkdir -p $(@D); $(if $(V),,echo "  CC  $<")
	$(Q)$(CC) $(TETLOD_CFLAGS) $(PACKAGE_CFLAGS) $(CPPFLAGS) $(CFLAGS) -MMD -MP -c -o $@ $<

# What bundles the page; exactly the versions of the lock file. npm itself writes the file that stands for all of it.
$(NODE_MODULES): $(WEB_DIR)/package.json $(WEB_DIR)/package-lock.json
	@command -v npm >/dev/null || { echo "make: node and npm are missing (run: make deps)" >&2; exit 1; }
	@echo "  NPM $(WEB_DIR)"
	$(Q)cd $(WEB_DIR) && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >/dev/null && \
	    touch node_modules/.package-lock.json

$(WASM): $(WASM_SRC) $(wildcard $(WEB_DIR)/wasm/*.h format/*.h format/*/*.h src/*/*.h) Makefile
	@mkdir -p $(@D)
	@command -v $(WASM_CC) >/dev/null || { echo "make: $(WASM_CC) is missing (run: make deps)" >&2; exit 1; }
	@echo "  WASM $@"
	$(Q)for f in $(WASM_SMALL); do $(WASM_CC) $(filter-out -mexec-model=%,$(WASM_CFLAGS)) -Oz -c -o \
	    $(@D)/$$(basename $$f .c).o $$f || exit 1; done
	$(Q)$(WASM_CC) $(WASM_CFLAGS) $(WASM_LDFLAGS) -o $@ $(filter-out $(WASM_SMALL),$(WASM_SRC)) \
	    $(patsubst %.c,$(@D)/%.o,$(notdir $(WASM_SMALL)))

$(REFINE): $(REFINE_SRC) $(wildcard $(WEB_DIR)/*/*.h format/*.h format/*/*.h src/*/*.h) Makefile
	@mkdir -p $(@D); echo "  WASM $@"
	$(Q)$(WASM_CC) $(WASM_CFLAGS) $(WASM_LDFLAGS) -o $@ $(REFINE_SRC)

# Modules that are parts of worker.js and refine.js in the package.
BUNDLED := worker.js engine.js network.js held.js choose.js pace.js steps.js vectors.js refine.js maker.js answers.js \
    paging.js pages.js sights.js

# The worker is one file: three loads one after the other would keep it waiting
$(CLIENT)/package.json: $(NODE_MODULES) $(WASM) $(REFINE) $(CLIENT_SRC) $(WEB_DIR)/inline.mjs $(WEB_STAMP) LICENSE
	@rm -rf $(@D) && mkdir -p $(@D)
	$(Q)$(WEB_DIR)/node_modules/.bin/esbuild $(WEB_DIR)/client/worker.js --bundle --format=esm --target=es2022 \
	    --log-level=warning --outfile=$(@D)/worker.js
	$(Q)$(WEB_DIR)/node_modules/.bin/esbuild $(WEB_DIR)/client/refine.js --bundle --format=esm --target=es2022 \
	    --log-level=warning --outfile=$(@D)/refine.js
	$(Q)cd $(WEB_DIR) && node_modules/.bin/esbuild page/element.js --bundle --splitting --minify --format=esm \
	    --target=es2022 --legal-comments=none --external:./inline.js --chunk-names=element-[hash] \
	    --log-level=warning --outdir=$(abspath $(@D))
	$(Q)cp $(WASM) $(REFINE) \
	    $(filter-out $(addprefix %/,$(BUNDLED)),$(CLIENT_SRC)) LICENSE $(@D)
	$(Q)cp $(WEB_OUT)/notices.txt $(@D)/
	$(Q)node $(WEB_DIR)/inline.mjs $(@D)/worker.js $(WASM) $(@D)/inline.js

$(VALIDATE): $(NODE_MODULES) $(WASM) $(CLIENT_SRC) $(WEB_DIR)/validate.mjs $(wildcard format/conformance/*.mjs) \
    $(wildcard format/conformance/*.html)
	$(Q)node $(WEB_DIR)/validate.mjs $(abspath $(WASM)) $@

build/widget.js: $(CLIENT)/package.json $(WEB_DIR)/widget.mjs $(wildcard $(WEB_DIR)/page/*.js)
	$(Q)node $(WEB_DIR)/widget.mjs $(CLIENT)/inline.js $@

build/web.stamp: $(NODE_MODULES) $(WASM) $(REFINE) $(WEB_SRC)
	@echo "  WEB $(WEB_DIR)"
	$(Q)node $(WEB_DIR)/build.mjs $(WEB_OUT) $(WASM) $(REFINE) && touch $@

build/api/openapi.json: server/api/describe.py server/api/tables.py server/routes/routes.def
	$(Q)python3 $< $@

$(EMBEDDED_SRC): server/embed.py $(if $(filter 0,$(WEB)),,$(WEB_STAMP)) build/api/openapi.json
	$(Q)python3 server/embed.py $(@D) $(if $(filter 0,$(WEB)),,$(WEB_OUT)) build/api

$(EMBEDDED): $(EMBEDDED_SRC) server/routes/assets.h $(B)/flags
	@mkdir -p $(@D)
	$(Q)$(CC) $(TETLOD_CFLAGS) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<

$(LIBTETLOD): $(call objects,$(FORMAT_SRC))
	@rm -f $@
	$(Q)$(AR) rcs $@ $^

$(SHARED): $(call objects,$(FORMAT_SRC))
	$(Q)$(CC) -shared $(if $(filter fuzz,$(config)),,-Wl$(comma)-z$(comma)defs) \
	    -Wl,-soname,libtetlod.so.$(SOVERSION) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $^ -lm
comma := ,

# One object, whose inner names are its own: a program that links it may have a `simplify` too
$(LIBBUILD): $(call objects,$(BUILD_SRC))
	@rm -f $@
	$(Q)$(LD) -r -o $(B)/tetlod-build.o $^ && $(OBJCOPY) --localize-hidden $(B)/tetlod-build.o && \
	    $(AR) rcs $@ $(B)/tetlod-build.o

# It brings the codec along, which exports nothing here
$(SHARED_BUILD): $(call objects,$(BUILD_SRC) $(FORMAT_SRC)) src/library/exports.map
	$(Q)$(CC) -shared $(if $(filter fuzz,$(config)),,-Wl$(comma)-z$(comma)defs) \
	    -Wl,-soname,libtetlod-build.so.$(SOVERSION) -Wl,--version-script=src/library/exports.map \
	    $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) -lm

# The program's large arrays may be in files (src/cli/scratch_memory.h)
WRAPPED := $(patsubst %,-Wl$(comma)--wrap=%,malloc calloc realloc aligned_alloc free pthread_create)
$(BINARY): $(CLI_OBJECTS) $(INTERNAL) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(PLACE) $(LDFLAGS) $(WRAPPED) -o $@ $^ $(PACKAGE_LIBS)

## mpi: tetlod-mpi, which builds with the ranks of an MPI job (deps-mpi installs OpenMPI)
MPICC ?= mpicc
HAS_MPI = $(shell command -v $(MPICC) 2>/dev/null)
MPI_BINARY := $(B)/tetlod-mpi
LIBMPI := $(B)/libtetlod-mpi.a
MPI_OBJECTS := $(call objects,$(sort $(wildcard src/mpi/*.c)))
MPI_TESTS := $(patsubst %.c,$(B)/%,$(sort $(wildcard tests/mpi/*.c)))
OBJECTS += $(MPI_OBJECTS) $(MPI_TESTS:=.o)
.PHONY: mpi
mpi: $(MPI_BINARY) $(LIBMPI)
# As libtetlod-build, which it brings along
$(LIBMPI): $(call objects,$(BUILD_SRC)) $(filter-out %/mpi_main.o,$(MPI_OBJECTS))
	@rm -f $@
	$(Q)$(LD) -r -o $(B)/tetlod-mpi.o $^ && $(OBJCOPY) --localize-hidden $(B)/tetlod-mpi.o
	$(Q)$(AR) rcs $@ $(B)/tetlod-mpi.o
$(MPI_OBJECTS) $(MPI_TESTS:=.o): $(B)/%.o: %.c $(B)/flags
	@mkdir -p $(@D); $(if $(V),,echo "  CC  $<")
	@command -v $(MPICC) >/dev/null || { echo "make: $(MPICC) is missing (run: make deps-mpi)" >&2; exit 1; }
	$(Q)OMPI_CC='$(CC)' MPICH_CC='$(CC)' $(MPICC) $(TETLOD_CFLAGS) $(PACKAGE_CFLAGS) $(CPPFLAGS) $(CFLAGS) -MMD -MP \
	    -c -o $@ $<
$(MPI_TESTS): %: %.o $(filter-out %/mpi_main.o,$(MPI_OBJECTS)) $(INTERNAL) $(LIBTETLOD)
	$(Q)OMPI_CC='$(CC)' MPICH_CC='$(CC)' $(MPICC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $^ $(PACKAGE_LIBS)
$(MPI_BINARY): $(MPI_OBJECTS) $(filter-out %/main.o %/main-alone.o,$(CLI_OBJECTS)) $(INTERNAL) $(LIBTETLOD)
	$(Q)OMPI_CC='$(CC)' MPICH_CC='$(CC)' $(MPICC) $(TETLOD_LDFLAGS) $(LDFLAGS) $(WRAPPED) -o $@ $^ $(PACKAGE_LIBS)

$(INTERNAL_ARCHIVE): $(INTERNAL)
	@rm -f $@
	$(Q)$(AR) rcsT $@ $^

# The manual says what the commands say.
MANUAL := $(B)/tetlod$(ALONE).1
$(MANUAL): $(BINARY) src/cli/man.py
	$(Q)python3 src/cli/man.py $(BINARY) > $@

$(B)/tests/unit/%: $(B)/tests/unit/%.o $(call objects,$(SUPPORT_SRC)) $(INTERNAL_ARCHIVE) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) $(INTERNAL_ARCHIVE) $(LIBTETLOD) $(PACKAGE_LIBS)

# What the builder asks the exact limit is taken down
$(B)/tests/unit/test_asked_once: private TETLOD_LDFLAGS += -Wl,--wrap=exact_examine

# What others do between two locks is done there
$(B)/tests/unit/test_site: private TETLOD_LDFLAGS += -Wl,--wrap=pthread_mutex_unlock

# Arrays are in files, as they are in the program
$(B)/tests/unit/test_scratch_memory: $(B)/src/cli/scratch_memory.o $(B)/src/cli/spare_files.o
$(B)/tests/unit/test_scratch_memory: private TETLOD_LDFLAGS += $(WRAPPED)

# The heap is counted (tests/heap.h)
$(addprefix $(B)/tests/unit/,test_region_room test_bounds): private TETLOD_LDFLAGS += \
    $(patsubst %,-Wl$(comma)--wrap=%,malloc calloc realloc strdup free)

# The browser's module, natively
VIEW_OBJECTS := $(call objects,$(wildcard $(WEB_DIR)/wasm/*.c))
OBJECTS += $(VIEW_OBJECTS)
$(B)/tests/unit/test_view: $(VIEW_OBJECTS)

$(B)/tests/bench/%: $(B)/tests/bench/%.o $(call objects,$(SUPPORT_SRC)) $(INTERNAL) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $^ $(PACKAGE_LIBS)

# A fuzz target runs under libFuzzer in config=fuzz, elsewhere it replays its corpus.
$(B)/tests/fuzz/fuzz_%: $(B)/tests/fuzz/fuzz_%.o $(if $(FUZZER),,$(B)/tests/fuzz/rerun.o) $(call \
    objects,$(SUPPORT_SRC)) $(INTERNAL_ARCHIVE) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(FUZZER) $(LDFLAGS) -o $@ $^ $(PACKAGE_LIBS)

$(B)/tests/oom/failmalloc.so $(B)/tests/cli/no_tmpfile.so: $(B)/%.so: %.c
	@mkdir -p $(@D)
	$(Q)$(CC) -std=c11 -O1 -fPIC -shared -o $@ $< -ldl

## needs: look for what a build asks for, on any system; needs-check: for what the tests ask for, too
.PHONY: needs needs-check
define look_for_needs
missing=; for c in $(NEEDS_COMMANDS); do command -v $$c >/dev/null || missing="$$missing $$c"; done; \
for p in $(REQUIRED); do $(PKG_CONFIG) --exists $$p 2>/dev/null || missing="$$missing $$p(pkg-config)"; done; \
$(if $(filter 0,$(WEB))$(PREBUILT),,! command -v $(WASM_CC) >/dev/null || echo 'int main(void) { return 0; }' | \
    $(WASM_CC) --target=wasm32-wasi -x c - -o /dev/null 2>/dev/null || missing="$$missing wasi-libc";)
endef
define look_for_tests
for c in $(filter-out $(NEEDS_COMMANDS),$(NEEDS_CHECK)); do command -v $$c >/dev/null || missing="$$missing $$c"; \
    done; \
for m in $(NEEDS_PYTHON); do /usr/bin/python3 -c "import $$m" 2>/dev/null || missing="$$missing python3-$$m"; done;
endef
say_needs = echo "make: this is missing:$$missing (make deps installs it on Debian; WEB=0 and SERVER=0 ask for less)" \
    >&2
# What is missing is installed where that is Debian's and root's to do
install_needs = [ -z "$$missing" ] || { if command -v apt-get >/dev/null && [ "$$(id -u)" = 0 ]; \
    then $(MAKE) --no-print-directory $(1); else $(say_needs); exit 1; fi; }
needs:
	@$(look_for_needs) $(call install_needs,deps-build)
needs-check:
	@$(look_for_needs) $(look_for_tests) $(call install_needs,deps-build deps-check)

## deps: install what is missing (Debian packages, as root); deps-build is the part that the program needs, deps-check
##   the tests', deps-bench the benchmarks', deps-vtk what vtk and paraview ask for, deps-mpi what mpi does, deps-insitu
##   an example on FEniCSx
.PHONY: deps deps-build deps-check deps-bench deps-vtk deps-mpi deps-insitu
deps: deps-build deps-check deps-bench
define install_missing
	@missing=; for p in $(1); do dpkg -s $$p 2>/dev/null | grep -q '^Status: install ok installed' || \
	    missing="$$missing $$p"; done; \
	if [ -z "$$missing" ]; then exit 0; fi; \
	if [ "$$(id -u)" != 0 ]; \
	    then echo "make: these packages are missing:$$missing (run: sudo apt-get install$$missing)" >&2; exit 1; fi; \
	echo "make: installs as root, with apt-get, what is missing:$$missing"; apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null
endef
deps-build:
	$(call install_missing,$(DEPS_BUILD))
deps-check:
	$(call install_missing,$(DEPS_CHECK))
deps-bench:
	$(call install_missing,$(DEPS_BENCH))
deps-vtk:
	$(call install_missing,$(DEPS_VTK))
deps-mpi:
	$(call install_missing,$(DEPS_MPI))
deps-insitu:
	$(call install_missing,$(DEPS_INSITU))

## demo: install, build, make a sample and its stream, serve it and print the viewer's URL
.PHONY: demo
demo: needs
	@mkdir -p build/demo
	@echo "make: builds tetlod, which takes a minute or two; build/demo/make.log says how far it is"
	@$(MAKE) $(PARALLEL) --no-print-directory all >build/demo/make.log 2>&1 || { tail -n 20 build/demo/make.log; exit 1; }
	$(BINARY) sample fin -o build/demo/fin.vtu
	$(BINARY) build build/demo/fin.vtu -o build/demo/fin.tetlod
	@echo "Try: curl -L 'http://127.0.0.1:8080/v1/meshes/fin/mesh?error=0.01&measure=sampled' -o coarse.vtu"
	$(BINARY) serve build/demo

## check: install, build and run all tests; ends with 'N passed, N failed' (ONLY=pattern runs some)
.PHONY: check
unexport ONLY # tests of the web client take it as a part of a test's name
check: needs-check
	$(Q)$(MAKE) $(PARALLEL) --no-print-directory all tests
	$(Q)$(MAKE) $(PARALLEL) --no-print-directory config=asan all tests
	$(Q)$(MAKE) $(PARALLEL) --no-print-directory config=tsan threaded
	@/usr/bin/python3 tests/run.py $(if $(ONLY),--only '$(ONLY)') release asan tsan

## tests: the test programs of this config
.PHONY: tests
tests: $(UNIT_TESTS) $(FUZZ_TARGETS) $(if $(filter release,$(config)),$(if $(HAS_MPI),$(MPI_BINARY) $(LIBMPI) \
    $(MPI_TESTS)) $(B)/tests/oom/failmalloc.so $(B)/tests/cli/no_tmpfile.so $(B)/tests/attack/attack \
    $(B)/tests/attack/proof $(B)/tests/attack/page_selections)

## fuzz: run each fuzz target for TIME seconds (TARGET=name for one)
.PHONY: fuzz
TIME ?= 60
fuzz: needs-check
	$(Q)$(MAKE) --no-print-directory config=fuzz tests
	@for t in $(if $(TARGET),fuzz_$(TARGET),$(notdir $(FUZZ_SRC:.c=))); do echo "== $$t"; \
	    mkdir -p build/fuzz/found/$$t tests/fuzz/corpus/$${t#fuzz_}; \
	ASAN_OPTIONS=allocator_may_return_null=1 build/fuzz/tests/fuzz/$$t -max_total_time=$(TIME) -rss_limit_mb=4096 \
	    -timeout=20 -artifact_prefix=build/fuzz/found/$$t/ build/fuzz/found/$$t tests/fuzz/corpus/$${t#fuzz_} || \
	    exit 1; done


## mutate: read MUTATIONS mutations of each file of each corpus, under the sanitizers, in twice the memory of the file
##   or 64 MB (TARGET=name for one; config=release: without)
.PHONY: mutate
MUTATIONS ?= 10000
mutate: needs-check
	$(Q)$(MAKE) --no-print-directory config=$(if $(filter command line,$(origin config)),$(config),asan) tests
	@cd build && for t in $(if $(TARGET),fuzz_$(TARGET),$(filter-out fuzz_request,$(notdir $(FUZZ_SRC:.c=)))); do \
	MUTATIONS=$(MUTATIONS) ASAN_OPTIONS=allocator_may_return_null=1 \
	    $(if $(filter command line,$(origin config)),$(config),asan)/tests/fuzz/$$t \
	    $(CURDIR)/tests/fuzz/corpus/$${t#fuzz_} || exit 1; done

## bench-defaults: what it costs that all fields are controlled, on results of six kinds
.PHONY: bench-defaults
BENCHES += bench-defaults
bench-defaults: needs-check
	$(Q)$(MAKE) $(PARALLEL) --no-print-directory all
	@/usr/bin/python3 tests/bench/defaults.py $(CURDIR)/$(BINARY)

## bench-answers: 200 pairs with known differences; questions of ten meshes; random fields of features; what they take
.PHONY: bench-answers
BENCHES += bench-answers
bench-answers: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@rm -rf build/scratch/bench-answers; mkdir -p build/scratch/bench-answers
	@cd build/scratch/bench-answers && export TETLOD=$(CURDIR)/$(BINARY) ROOT=$(CURDIR) SCRATCH=$$PWD CONFIG=release \
	    PYTHONPATH=$(CURDIR)/tests:$(CURDIR)/tests/cli; PAIRS=200 /usr/bin/python3 $(CURDIR)/tests/cli/test_diff.py && \
	    ANSWERS=1 /usr/bin/python3 $(CURDIR)/tests/cli/test_ask.py && \
	    BOXES=100 /usr/bin/python3 $(CURDIR)/tests/cli/test_box_sums.py && \
	    /usr/bin/python3 $(CURDIR)/tests/attack/features.py 1 1000 && \
	    /usr/bin/python3 $(CURDIR)/tests/bench/answer_times.py $(CURDIR)/$(BINARY) $$PWD

## bench-selections: 2,000 random selections of pages of eleven meshes against the originals, by the overlay
##   (BLUNT=folder of the blunt fin); bench-mutations: MUTATIONS (1000000) changed pages of these meshes, FIRST=seed,
##   config=asan: under the sanitizers
MUTATIONS ?= 1000000
.PHONY: bench-selections bench-mutations
BENCHES += bench-selections bench-mutations
bench-selections: needs-check
	$(Q)$(MAKE) --no-print-directory all $(SELECTION_JUDGE)
	@TETLOD=$(CURDIR)/$(BINARY) BLUNT=$(BLUNT) /usr/bin/python3 tests/attack/selections.py 1 2000
bench-mutations: needs-check
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/unit/test_page_mutation
	@TETLOD=$(CURDIR)/$(BINARY) BLUNT=$(BLUNT) /usr/bin/python3 tests/attack/mutations.py $(FIRST) $(MUTATIONS)

## bench-server: levels that are not cached, memory; bench-http: bytes beside nginx; bench-day: 2,000 changes of files
##   under load; bench-opening: the first answers of ten million tetrahedra; bench-pressure: slow readers, a hundred
##   streams; bench-soak: a minute of mixed load; bench-hostile: HOSTILE hostile requests (500000), under the sanitizers
HOSTILE ?= 500000
.PHONY: bench-server bench-http bench-day bench-opening bench-pressure bench-soak bench-hostile
BENCHES += bench-server bench-http bench-day bench-opening bench-pressure bench-soak bench-hostile
bench-server: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@python3 tests/bench/server.py $(BINARY)
bench-http: needs-check
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/tile_stream
	@/usr/bin/python3 tests/bench/nginx.py $(BINARY) $(B)/tests/bench/tile_stream
bench-day: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@rm -rf build/scratch/bench-day; mkdir -p build/scratch/bench-day
	@cd build/scratch/bench-day && CHANGES=2000 TETLOD=$(CURDIR)/$(BINARY) ROOT=$(CURDIR) SCRATCH=$$PWD \
	    CONFIG=release /usr/bin/python3 $(CURDIR)/tests/http/test_changing_files.py
bench-opening: needs
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/tile_stream
	@python3 tests/bench/opening.py $(BINARY) $(B)/tests/bench/tile_stream
bench-pressure: needs
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/tile_stream
	@python3 tests/bench/pressure.py $(BINARY) $(B)/tests/bench/tile_stream
bench-soak: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@python3 tests/bench/soak.py $(BINARY) $(TIME)
bench-hostile: needs-check
	$(Q)$(MAKE) --no-print-directory config=asan all
	@rm -rf build/scratch/bench-hostile; mkdir -p build/scratch/bench-hostile
	@cd build/scratch/bench-hostile && HOSTILE=$(HOSTILE) TETLOD=$(CURDIR)/build/asan/tetlod ROOT=$(CURDIR) \
	    SCRATCH=$$PWD CONFIG=asan /usr/bin/python3 $(CURDIR)/tests/http/test_hostile.py

## bench-format: sizes of streams, by column, and speeds against tests/bench/format_sizes.csv (BLUNT=folder of the blunt
##   fin; UPDATE=1 takes over)
.PHONY: bench-format
BENCHES += bench-format
bench-format: needs-check
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/bench_format $(B)/tests/bench/bench_columns
	@/usr/bin/python3 tests/bench/bench_format.py $(BINARY) $(B)/tests/bench tests/bench/format_sizes.csv \
	    build/bench-format

## bench-series: what a series in time costs: the blunt fin with a displaced pressure, 32 steps (BLUNT=folder)
.PHONY: bench-series
BENCHES += bench-series
bench-series: needs-check
	$(Q)$(MAKE) --no-print-directory all build/client/package.json
	@/usr/bin/python3 tests/bench/series.py $(BINARY) $(BLUNT) build/bench-series

## bench-python: what a level takes in Python, of a file and of a server, with libtetlod and without (BLUNT=folder of
##   the blunt fin)
.PHONY: bench-python
BENCHES += bench-python
bench-python: needs
	$(Q)$(MAKE) --no-print-directory all
	@/usr/bin/python3 tests/bench/python_client.py $(BINARY) $(CURDIR)/$(SHARED)

## bench-thesis: the thesis's Tables 4.1 and 4.2 beside ours; bench-builder: percent of tetrahedra left, by metric and
##   mesh (BLUNT=folder of the blunt fin)
.PHONY: bench-thesis bench-builder
BENCHES += bench-thesis bench-builder
bench-thesis bench-builder: bench-%: needs
	$(Q)$(MAKE) --no-print-directory all
	@python3 tests/bench/$*.py $(BINARY)

## bench-build: what building costs beside VTK's decimation, one and two threads, and the true error of both
##   (BLUNT=folder; MESHES='blunt cube:60'; REPEAT=3)
.PHONY: bench-build
BENCHES += bench-build
bench-build: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@/usr/bin/python3 tests/bench/build.py $(BINARY) $(MESHES)

## bench-busy: what two threads gain alone, and beside BUSY=1 endless loops (MESHES=cube:60; REPEAT=5)
.PHONY: bench-busy
BENCHES += bench-busy
bench-busy: needs
	$(Q)$(MAKE) --no-print-directory all
	@/usr/bin/python3 tests/bench/busy.py $(BINARY) $(MESHES)

## bench-tasks: streams by tasks that come by chance, two of them killed, against build (BLUNT=folder of the blunt fin;
##   SIZE=60 of the cube; TASKS=6)
.PHONY: bench-tasks
BENCHES += bench-tasks
bench-tasks: needs
	$(Q)$(MAKE) --no-print-directory all
	@BLUNT=$(BLUNT) /usr/bin/python3 tests/bench/tasks.py $(BINARY)

## bench-io: reading and writing VTU of ten million tetrahedra beside VTK's reader and writer (SIZE=60: 1.3 million;
##   REPEAT=5)
.PHONY: bench-io
BENCHES += bench-io
bench-io: needs-check
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/bench_io
	@/usr/bin/python3 tests/bench/mesh_files.py $(B)/tests/bench/bench_io $(BINARY) $(SIZE)

## report: one HTML page: error against bytes beside VTK's decimation and compressed VTU, bytes by column, build time by
##   phase (MESHES='a.tetlod fin:30')
.PHONY: report
report: needs-check
	$(Q)$(MAKE) --no-print-directory all $(B)/tests/bench/bench_columns
	@/usr/bin/python3 tests/bench/report_page.py $(BINARY) $(B)/tests/bench/bench_columns build/report.html $(MESHES)

## attack: SEEDS random adversarial meshes with random options, held against an oracle (FIRST=seed to begin with)
.PHONY: attack
SEEDS ?= 2000
FIRST ?= 1
ATTACK := $(B)/tests/attack/attack
ORACLE_OBJECTS := $(call objects,$(filter-out tests/attack/attack.c tests/attack/falsify.c \
    tests/attack/page_selections.c tests/attack/proof.c,$(wildcard tests/attack/*.c)))
ATTACK_OBJECTS := $(ORACLE_OBJECTS) $(call objects,tests/attack/attack.c tests/attack/falsify.c tests/recode.c)
PROOF := $(B)/tests/attack/proof
SELECTION_JUDGE := $(B)/tests/attack/page_selections
OBJECTS += $(ATTACK_OBJECTS) $(B)/tests/attack/proof.o $(SELECTION_JUDGE).o
$(SELECTION_JUDGE): $(SELECTION_JUDGE).o $(ORACLE_OBJECTS) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $^ -lm
$(ATTACK): $(ATTACK_OBJECTS) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $^ -lm
$(PROOF): $(B)/tests/attack/proof.o $(ORACLE_OBJECTS) $(INTERNAL) $(LIBTETLOD)
	$(Q)$(CC) $(TETLOD_LDFLAGS) $(LDFLAGS) -o $@ $(filter-out $(LIBTETLOD),$^) $(LIBTETLOD) $(PACKAGE_LIBS)
attack: needs
	$(Q)$(MAKE) --no-print-directory all $(ATTACK) $(SELECTION_JUDGE)
	@python3 tests/attack/run_attack.py $(ATTACK) $(BINARY) $(B)/attack $(SEEDS) $(FIRST)
	@/usr/bin/python3 tests/attack/doors.py $(BINARY) $(B)/attack $(SEEDS) $(FIRST)
	@/usr/bin/python3 tests/attack/features.py $(FIRST) $(SEEDS)
	@/usr/bin/python3 tests/attack/selections.py $(FIRST) $(SEEDS)

## mutants: take one line of the proof out at a time; a test must go red (NAME='one of tests/mutants/table.py')
.PHONY: mutants
mutants: needs
	$(Q)$(MAKE) --no-print-directory all tests $(ATTACK)
	@python3 tests/mutants/run_mutants.py $(if $(NAME),'$(NAME)')

## bench-certificate: 100 random levels of all samples and the blunt fin (BLUNT=folder), 200,000 points each, against
##   what is promised of them
.PHONY: bench-certificate
BENCHES += bench-certificate
bench-certificate: $(B)/tests/unit/test_certificate
	@CERTIFICATE=1 ROOT=$(CURDIR) $<

## bench-cut: what pictures of 511,104 tetrahedra take, natively and as WebAssembly
.PHONY: bench-cut
BENCHES += bench-cut
build/wasm/bench_cut.wasm: tests/bench/bench_cut.c $(WASM) Makefile
	$(Q)$(WASM_CC) $(filter-out -mexec-model=reactor,$(WASM_CFLAGS)) $(WASM_LDFLAGS) -o $@ $< $(CUT_SRC) \
	    format/status.c $(WEB_DIR)/wasm/print.c
bench-cut: needs $(B)/tests/bench/bench_cut build/wasm/bench_cut.wasm
	@echo "== native"; $(B)/tests/bench/bench_cut
	@echo "== WebAssembly"; node tests/bench/run_wasm.mjs build/wasm/bench_cut.wasm

## bench-web: the web client in headless Chromium, over a slow link and in pages (BLUNT=folder of the blunt fin, FLY=60,
##   BIG=stream of ten million tetrahedra)
.PHONY: bench-web
BENCHES += bench-web
bench-web: needs-check
	$(Q)$(MAKE) --no-print-directory all
	@node tests/bench/web.mjs $(BINARY) build/bench-web$(if $(BLUNT),-blunt)
	@node tests/bench/fly.mjs $(BINARY) build/bench-web $(FLY)

## bench: measure; bench-* are its parts
.PHONY: bench
bench: needs-check $(BENCHES)

## check-tsan: all tests of the server under the thread sanitizer, of which `check` runs some; threaded: builds what
##   they need
.PHONY: check-tsan threaded
threaded: $(BINARY) $(patsubst %,$(B)/tests/unit/test_%,cache forest site)
check-tsan: needs-check
	$(Q)$(MAKE) $(PARALLEL) --no-print-directory config=tsan threaded
	@/usr/bin/python3 tests/run.py --every tsan --only http/
	@/usr/bin/python3 tests/run.py tsan --only unit/

## figures: the pictures of the documents, from the program's output (BLUNT=folder of the blunt fin: those of it, too)
.PHONY: figures
figures: needs-check all
	@mkdir -p build/figures samples/figures
	$(BINARY) sample fin -o build/figures/fin.vtu
	$(BINARY) build build/figures/fin.vtu -o build/figures/fin.tetlod --quiet
	/usr/bin/python3 tests/figures/level_sequence.py $(BINARY) build/figures/fin.tetlod \
	    samples/figures/fin_levels.png --field Pressure --width 230
ifdef BLUNT
	$(BINARY) build $(BLUNT)/bluntfinxyz.bin --q $(BLUNT)/bluntfinq.bin --field Pressure --carry Pressure -o \
	    build/figures/blunt.tetlod --quiet
	$(BINARY) build $(BLUNT)/bluntfinxyz.bin --q $(BLUNT)/bluntfinq.bin --field Pressure --carry Pressure \
	    --local-bound -o build/figures/bounded.tetlod --quiet
	TETLOD=$(BINARY) node tests/figures/blunt_fin.mjs build/figures/blunt.tetlod build/figures/bounded.tetlod \
	    samples/figures
endif

define newline


endef
## install: program, libraries, headers, manual, completion and systemd units into $(DESTDIR)$(PREFIX); uninstall
##   removes them again
.PHONY: install uninstall
pc = { printf 'prefix=%s\nlibdir=%s\nincludedir=%s\n\n' '$(PREFIX)' '$(libdir)' '$(includedir)'; \
    printf 'Name: %s\nDescription: levels of detail for tetrahedral volumes%s\n' $(1) '$(2)'; \
    printf 'Version: %s\n' '$(VERSION)'; \
    printf 'Libs: -L$${libdir} -l%s\nLibs.private: %s\nCflags: -I$${includedir}\n' $(1) '$(3)'; } \
    > $(DESTDIR)$(libdir)/pkgconfig/$(1).pc
install_library = $(INSTALL) -m 644 $(1).a $(DESTDIR)$(libdir)/; $(INSTALL) -m 644 $(1).so.$(VERSION) \
    $(DESTDIR)$(libdir)/; \
    ln -sf $(notdir $(1)).so.$(VERSION) $(DESTDIR)$(libdir)/$(notdir $(1)).so.$(SOVERSION); \
    ln -sf $(notdir $(1)).so.$(SOVERSION) $(DESTDIR)$(libdir)/$(notdir $(1)).so
cmakedir = $(libdir)/cmake/tetlod
cmake_file = sed 's|@version@|$(VERSION)|; s|@includedir@|'"$$(realpath -ms --relative-to=$(cmakedir) $(includedir))|" \
    src/library/cmake/$(1).cmake > $(DESTDIR)$(cmakedir)/$(1).cmake
install: all $(MANUAL)
	$(INSTALL) -d \
	    $(addprefix $(DESTDIR),$(bindir) $(libdir)/pkgconfig $(cmakedir) $(includedir) $(mandir)/man1 $(completionsdir)) \
	    $(if $(ALONE),,$(DESTDIR)$(unitdir))
	$(INSTALL) -m 755 $(BINARY) $(DESTDIR)$(bindir)/tetlod
	$(call install_library,$(LIBTETLOD:.a=))
	$(call install_library,$(LIBBUILD:.a=))
	$(INSTALL) -m 644 format/tetlod.h $(DESTDIR)$(includedir)/tetlod.h
	sed 's|"format/tetlod.h"|<tetlod.h>|' src/library/tetlod_build.h > $(DESTDIR)$(includedir)/tetlod_build.h
	$(INSTALL) -m 644 $(MANUAL) $(DESTDIR)$(mandir)/man1/tetlod.1
	$(INSTALL) -m 644 src/cli/tetlod.bash $(DESTDIR)$(completionsdir)/tetlod
	$(if $(ALONE),,sed 's|/usr/local/bin/|$(bindir)/|' server/deploy/tetlod.service > $(DESTDIR)$(unitdir)/tetlod.service)
	$(if $(ALONE),,$(INSTALL) -m 644 server/deploy/tetlod.socket $(DESTDIR)$(unitdir)/tetlod.socket)
	$(if $(filter 0,$(WEB))$(ALONE),,$(INSTALL) -D -m 644 $(WEB_OUT)/notices.txt $(DESTDIR)$(docdir)/notices.txt)
	$(call pc,tetlod,,-lm)
	$(call pc,tetlod-build, (building streams),-ltetlod -pthread -lm)
	$(call cmake_file,tetlod-config)
	$(call cmake_file,tetlod-config-version)
uninstall:
	rm -f $(DESTDIR)$(bindir)/tetlod $(DESTDIR)$(libdir)/libtetlod.* $(DESTDIR)$(libdir)/libtetlod-build.* \
	    $(DESTDIR)$(includedir)/tetlod.h $(DESTDIR)$(includedir)/tetlod_build.h \
	    $(DESTDIR)$(mandir)/man1/tetlod.1 $(DESTDIR)$(completionsdir)/tetlod $(DESTDIR)$(libdir)/pkgconfig/tetlod.pc \
	    $(DESTDIR)$(libdir)/pkgconfig/tetlod-build.pc $(DESTDIR)$(unitdir)/tetlod.service \
	    $(DESTDIR)$(unitdir)/tetlod.socket \
	    $(DESTDIR)$(docdir)/notices.txt $(addprefix $(DESTDIR)$(cmakedir)/,tetlod-config.cmake tetlod-config-version.cmake)

## vtk: vtkTetlodReader as a module of VTK with its wrapping for Python, in build/vtk; paraview: the plugin of ParaView,
##   in build/paraview (make deps-vtk)
.PHONY: vtk paraview
VTK_STAGE := $(CURDIR)/build/vtk-stage
vtk paraview: all
	@command -v cmake >/dev/null || { echo "make: cmake is missing (run: make deps-vtk)" >&2; exit 1; }
	$(Q)$(MAKE) -s install DESTDIR=$(VTK_STAGE) PREFIX=/usr libdir=/usr/lib INSTALL='install -C' >/dev/null
	$(Q)cmake -S client-examples/vtk -B build/$@ -DTETLOD_PARAVIEW=$(if $(filter paraview,$@),ON,OFF) \
	    -DCMAKE_PREFIX_PATH=$(VTK_STAGE)/usr $(CMAKE_OPTIONS) >build/$@.log && cmake --build build/$@ >>build/$@.log

## install-mpi: tetlod-mpi and its manual, and libtetlod-mpi
.PHONY: install-mpi
install-mpi: mpi
	$(INSTALL) -d $(addprefix $(DESTDIR),$(bindir) $(libdir)/pkgconfig $(includedir) $(mandir)/man1)
	$(INSTALL) -m 644 $(LIBMPI) $(DESTDIR)$(libdir)/libtetlod-mpi.a
	sed 's|"src/library/tetlod_build.h"|<tetlod_build.h>|' src/mpi/tetlod_mpi.h > $(DESTDIR)$(includedir)/tetlod_mpi.h
	$(call pc,tetlod-mpi, (building streams on the ranks of an MPI job),-ltetlod -pthread -lm)
	$(INSTALL) -m 755 $(MPI_BINARY) $(DESTDIR)$(bindir)/tetlod-mpi
	$(INSTALL) -m 644 src/mpi/tetlod-mpi.1 $(DESTDIR)$(mandir)/man1/tetlod-mpi.1

## install-python: the Python package, with the plugin for ParaView, into $(DESTDIR)$(pythondir)
.PHONY: install-python install-doc
pythondir ?= $(PREFIX)/lib/python3/dist-packages
distinfo = $(pythondir)/tetlod-$(VERSION).dist-info
install-python:
	$(INSTALL) -d $(DESTDIR)$(pythondir)/tetlod $(DESTDIR)$(distinfo)
	$(INSTALL) -m 644 $(addprefix client-examples/python/tetlod/,*.py py.typed) $(DESTDIR)$(pythondir)/tetlod/
	$(if $(wildcard $(WIDGET)),$(INSTALL) -m 644 $(WIDGET) $(WEB_OUT)/notices.txt $(DESTDIR)$(pythondir)/tetlod/)
	printf 'Metadata-Version: 2.1\nName: tetlod\nVersion: %s\nRequires-Dist: numpy\n' \
	    '$(VERSION)' > $(DESTDIR)$(distinfo)/METADATA
	printf '[%s]\n%s\n' pyvista.readers '.tetlod = tetlod.adapters:read_pyvista' \
	    pyvista.writers '.tetlod = tetlod.adapters:write_pyvista' \
	    xarray.backends 'tetlod = tetlod._xarray:TetlodBackend' > $(DESTDIR)$(distinfo)/entry_points.txt

## install-doc: documents and examples into $(DESTDIR)$(docdir)
DOCUMENTS = README.md CHANGELOG.md format/SPEC.md server/HTTP.md src/README.md src/io/FORMATS.md \
    $(wildcard samples/figures/*.png samples/*.md client-examples/*.md client-examples/*/*.md)
EXAMPLES = $(wildcard client-examples/c/*.c client-examples/python/*.ipynb client-examples/python/insitu_*.py \
    client-examples/web/example*)
install-doc:
	$(foreach f,$(DOCUMENTS),$(INSTALL) -D -m 644 $(f) $(DESTDIR)$(docdir)/$(f)$(newline)	)
	$(foreach f,$(EXAMPLES),$(INSTALL) -D -m 644 $(f) $(DESTDIR)$(docdir)/examples/$(f:client-examples/%=%)$(newline)	)
	$(if $(wildcard $(VALIDATE)),$(INSTALL) -D -m 644 $(VALIDATE) $(DESTDIR)$(docdir)/format/validate.html)

## amalgamation: the reader as two files, build/amalgamation/tetlod.c and tetlod.h, to be copied into another program
.PHONY: amalgamation
amalgamation:
	$(Q)python3 format/amalgamate.py build/amalgamation $(filter-out $(WRITING),$(FORMAT_SRC))
	@ls build/amalgamation/tetlod.[ch]

## dist: the sources with the page prebuilt: what is built from them needs neither npm nor a network
.PHONY: dist
DIST := tetlod-$(VERSION)
dist: all
	@rm -rf build/dist && mkdir -p build/dist/$(DIST)/$(WEB_DIR)/prebuilt
	$(Q)git ls-files -z | xargs -0 cp -p --parents -t build/dist/$(DIST)
	$(Q)cp -R $(WEB_OUT) build/dist/$(DIST)/$(WEB_DIR)/prebuilt/page
	$(Q)cp -R $(CLIENT) build/dist/$(DIST)/$(WEB_DIR)/prebuilt/client
	$(Q)cp $(WIDGET) build/dist/$(DIST)/$(WEB_DIR)/prebuilt/
	$(Q)tar -C build/dist --sort=name --owner=0 --group=0 --numeric-owner --mtime=@$$(git log -1 --format=%ct) -c \
	    $(DIST) | gzip -9n > build/$(DIST).tar.gz
	@echo "build/$(DIST).tar.gz"

## deb: Debian packages of what is built, in build/deb: tetlod, libtetlod0, libtetlod-dev, python3-tetlod, tetlod-doc;
##   with paraview-dev tetlod-paraview
DEB_PROFILES = $(if $(wildcard /usr/lib/*/cmake/paraview-*),pkg.tetlod.paraview )$(if $(HAS_MPI),pkg.tetlod.mpi)
.PHONY: deb
deb: all $(MANUAL)
	@command -v dh >/dev/null || { echo "make: debhelper is missing (run: make deps)" >&2; exit 1; }
	@rm -rf build/deb && mkdir -p build/deb/$(DIST)
	$(Q)cp -R server/deploy/debian build/deb/$(DIST)/
	$(Q)cd build/deb/$(DIST) && DEB_BUILD_OPTIONS=noautodbgsym DEB_BUILD_PROFILES='$(DEB_PROFILES)' TREE=$(CURDIR) \
	    debian/rules binary
	@cd build/deb && ls *.deb

## clean: remove build/
.PHONY: clean
clean:
	rm -rf build

## help: this list
.PHONY: help
help:
	@sed -n 's/^## //p' $(firstword $(MAKEFILE_LIST))

OBJECTS += $(call objects,$(wildcard tests/bench/*.c))
-include $(OBJECTS:.o=.d)
