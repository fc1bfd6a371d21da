/* SPDX-License-Identifier: BSD-3-Clause */
/* The formats behind io.h. Each reader turns bytes into a mesh that io_read then validates; whatever it has filled in
 * before a failure, io_read frees. */
#ifndef TETLOD_FORMATS_H
#define TETLOD_FORMATS_H

#include <stdbool.h>

#include "src/io/assemble.h"

/* io_read for a file that is in memory; the path only tells the extension, messages do not have it. On failure *out may
 * hold what there is so far. */
TETLOD_CHECKED enum tetlod_status io_read_input(struct tetmesh *out, const char *path, const struct io_input *input,
                                                struct io_report *report, struct tetlod_error *error);

/* For readers of files that name others: reads the file `name` beside `from`, whatever its format. Outside the folder only
 * with the option `follow`. */
TETLOD_CHECKED enum tetlod_status io_read_named(struct blocks *out, const struct io_input *from, const char *name,
                                                struct io_report *report, struct tetlod_error *error);

/* The path of such a file; the caller frees it. */
TETLOD_CHECKED enum tetlod_status io_resolve(const struct io_input *from, const char *name, char **out,
                                             struct tetlod_error *error);

/* Whether the word stands somewhere in the bytes. */
bool sniff_holds(const unsigned char *bytes, size_t size, const char *word);

bool vtkxml_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status vtkxml_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

bool vtk_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status vtk_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

bool gmsh_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status gmsh_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status gmsh_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);

/* The other file of a Medit mesh is its .sol, that of a TetGen .node its .ele, which it must have. */
bool medit_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status medit_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status tetgen_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

TETLOD_CHECKED enum tetlod_status stl_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                            struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status ply_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                            struct tetlod_error *error);

bool stream_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status stream_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

bool plot3d_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status plot3d_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

/* A unit in the XML of an array of VTK's: the text between. */
#define VTK_XML_UNIT "<InformationKey name=\"UNITS_LABEL\" location=\"vtkDataArray\">"
#define VTK_XML_UNIT_END "</InformationKey>"

/* On top of libraries that may be left out of a build. */
bool vtkhdf_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status vtkhdf_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);
bool xdmf_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status xdmf_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);
bool exodus_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status exodus_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);
bool cgns_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status cgns_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

/* Abaqus and CalculiX. */
bool inp_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status inp_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                           struct tetlod_error *error);

TETLOD_CHECKED enum tetlod_status medit_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status meshb_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status sol_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status xdmf_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtkhdf_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status exodus_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtp_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status glb_write(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                             struct tetlod_error *error);

/* EnSight Gold: the case, which names the other files. */
bool ensight_sniff(const unsigned char *bytes, size_t size);
TETLOD_CHECKED enum tetlod_status ensight_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                               struct tetlod_error *error);

/* OpenFOAM: the file marks the folder of the case. */
TETLOD_CHECKED enum tetlod_status foam_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                                            struct tetlod_error *error);

#endif
