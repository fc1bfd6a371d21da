/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/registry.h"

#include <string.h>
#include <strings.h>

/* Formats that need a library: without it a name that says so. */
#ifdef TETLOD_HDF5
#define WITH_HDF5(function) function
#else
#define WITH_HDF5(function) NULL
#endif
#ifdef TETLOD_NETCDF
#define WITH_NETCDF(function) function
#else
#define WITH_NETCDF(function) NULL
#endif
#ifdef TETLOD_CGNS
#define WITH_CGNS(function) function
#else
#define WITH_CGNS(function) NULL
#endif

/* In the order in which contents are tried: PLOT3D, which has no magic, last. */
static const struct format formats[] = {
    {"tetlod", "a stream's finest level", {"tetlod"}, ONE, stream_sniff, stream_read, NULL},
    {"vtu", "VTK XML: unstructured grids", {"vtu"}, ONE, vtkxml_sniff, vtkxml_read, io_write_vtu},
    {"vtkxml",
     "VTK XML: parallel forms, structured, rectilinear and image grids, multi-block, time",
     {"pvtu", "vts", "vtr", "vti", "vtm", "pvd", "pvts", "pvtr", "pvti", "vtpd", "vtpc"},
     ONE,
     NULL,
     vtkxml_read,
     NULL},
    {"vtk", "legacy VTK 1.0 to 5.1", {"vtk"}, ONE, vtk_sniff, vtk_read, io_write_vtk},
    {"gmsh", "Gmsh 2.0 to 2.2, 4.0 and 4.1", {"msh"}, ONE, gmsh_sniff, gmsh_read, gmsh_write},
    {"vtkhdf",
     "VTKHDF: unstructured grids and images, steps in time (libhdf5)",
     {"vtkhdf", "hdf"},
     ONE,
     WITH_HDF5(vtkhdf_sniff),
     WITH_HDF5(vtkhdf_read),
     WITH_HDF5(vtkhdf_write)},
    {"xdmf",
     "XDMF 2 and 3: text, raw, HDF5; collections (libhdf5)",
     {"xdmf", "xmf"},
     ONE,
     WITH_HDF5(xdmf_sniff),
     WITH_HDF5(xdmf_read),
     xdmf_write},
    {"exodus",
     "Exodus II: element blocks, steps in time (libnetcdf)",
     {"exo", "e", "ex2", "exii"},
     ONE,
     WITH_NETCDF(exodus_sniff),
     WITH_NETCDF(exodus_read),
     WITH_NETCDF(exodus_write)},
    {"cgns",
     "CGNS: unstructured and structured zones, polyhedra, steps in time (libcgns)",
     {"cgns"},
     ONE,
     WITH_CGNS(cgns_sniff),
     WITH_CGNS(cgns_read),
     NULL},
    {"stl", "the boundary surface", {"stl"}, ONE, NULL, NULL, stl_write},
    {"ply", "the boundary surface with all fields", {"ply"}, ONE, NULL, NULL, ply_write},
    {"vtp", "the boundary surface with all fields", {"vtp"}, ONE, NULL, NULL, vtp_write},
    {"glb", "the boundary surface, coloured, with fields as attributes", {"glb"}, ONE, NULL, NULL, glb_write},
    {"usda", "USD as text: a TetMesh of UsdGeom, fields as primvars", {"usda"}, ONE, NULL, NULL, usda_write},
    {"inp", "Abaqus and CalculiX: nodes and elements", {"inp"}, ONE, inp_sniff, inp_read, NULL},
    {"medit",
     "Medit with its .sol, text and binary (text is written)",
     {"mesh"},
     SOLUTION,
     medit_sniff,
     medit_read,
     medit_write},
    {"meshb", "Medit binary, versions 1 to 4, with its .solb", {"meshb"}, SOLUTION, NULL, medit_read, meshb_write},
    {"sol", "Medit's values at vertices: --q, and the fields of a .mesh", {"sol"}, ONE, NULL, NULL, sol_write},
    {"openfoam",
     "OpenFOAM cases by an empty NAME.foam in their folder: text, binary, gzip, polyhedra, times",
     {"foam", "openfoam"},
     FOLDER,
     NULL,
     foam_read,
     NULL},
    {"mfem", "MFEM meshes, with a grid function by --q", {"mfem"}, SOLUTION, mfem_sniff, mfem_read, NULL},
    {"ensight",
     "EnSight 6 and Gold cases: text, C and Fortran binary, parts, variables of nodes and elements, times",
     {"case", "encas"},
     ONE,
     ensight_sniff,
     ensight_read,
     NULL},
    {"tetgen", "TetGen .node with .ele", {"node", "ele"}, SIBLING, NULL, tetgen_read, NULL},
    {"plot3d",
     "PLOT3D grids with their solution: multi-grid, iblank, both endians, record markers",
     {"xyz", "p3d", "x"},
     SOLUTION,
     plot3d_sniff,
     plot3d_read,
     NULL},
};

enum { FORMATS = sizeof formats / sizeof *formats };

const struct format *format_by_extension(const char *path)
{
    const char *dot = strrchr(path, '.');
    for (int f = 0; dot && f < FORMATS; f++)
        for (int e = 0; e < MAX_EXTENSIONS && formats[f].extensions[e]; e++)
            if (strcasecmp(dot + 1, formats[f].extensions[e]) == 0)
                return &formats[f];
    return NULL;
}

const struct format *format_find(const char *path, const unsigned char *bytes, size_t size)
{
    const struct format *named = format_by_extension(path);
    if (named && named->sniff && named->sniff(bytes, size))
        return named;
    for (int f = 0; f < FORMATS; f++)
        if (formats[f].sniff && formats[f].sniff(bytes, size))
            return &formats[f];
    return named && named->read ? named : NULL;
}

const struct format *format_at(size_t number)
{
    return number < FORMATS ? &formats[number] : NULL;
}
