/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The readers. `NAME_sniff`: whether the first bytes of a file are of that format. Whatever a reader has filled in
 * before a failure, its caller frees. A reader that takes a second file: Medit's is the .sol, MFEM's a grid function,
 * TetGen's .node must have its .ele, PLOT3D's is the solution. The file of an EnSight case names the others, that of an
 * OpenFOAM case marks its folder.
 */
#ifndef TETLOD_IO_READERS_H
#define TETLOD_IO_READERS_H

#include "src/io/services/assemble.h"

typedef bool io_sniffer(const unsigned char *bytes, size_t size);

io_sniffer vtkxml_sniff, vtk_sniff, gmsh_sniff, medit_sniff, stream_sniff, plot3d_sniff, vtkhdf_sniff, xdmf_sniff,
    exodus_sniff, cgns_sniff, inp_sniff, ensight_sniff, mfem_sniff;

io_reader vtkxml_read, vtk_read, gmsh_read, medit_read, tetgen_read, stream_read, plot3d_read, vtkhdf_read, xdmf_read,
    exodus_read, cgns_read, inp_read, ensight_read, foam_read, mfem_read;

#endif
