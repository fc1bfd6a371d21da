// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class vtkTetlodReader
 * @brief reads tetlod streams: a level of detail of a tetrahedral mesh, at the error that is asked for
 *
 * FileName is a file, a mesh of a tetlod server (http://host:8080/v1/meshes/NAME, or its page) or the URL of a stream
 * on any web host. The stream stays open: a change of the error refines or coarsens the mesh that is there, and a host
 * is asked only for bytes that are missing.
 *
 * Output 0 is the level, or the step of a series whose time is nearest to the time that the pipeline asks for. With
 * Box on, output 0 of a stream in pages is one mesh, within BoxError in the box: its cell array Region is 1 there, 0
 * outside and 2 in the transition between them. Of other streams and of steps, output 1 has the tetrahedra within
 * BoxError that meet the box. Output 1 is empty otherwise.
 *
 * Progress events come while bytes arrive and records are decoded. AbortExecute, set meanwhile, ends the work; the
 * output is what was there before, and the next change goes on from what was decoded.
 */
#ifndef vtkTetlodReader_h
#define vtkTetlodReader_h

#include <memory>

#include "vtkIOTetlodModule.h"
#include "vtkUnstructuredGridAlgorithm.h"

class vtkDataArraySelection;

class VTKIOTETLOD_EXPORT vtkTetlodReader : public vtkUnstructuredGridAlgorithm
{
public:
  static vtkTetlodReader* New();
  vtkTypeMacro(vtkTetlodReader, vtkUnstructuredGridAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** The stream: a path or a URL. */
  vtkSetFilePathMacro(FileName);
  vtkGetFilePathMacro(FileName);
  ///@}

  /** 1 for a file that begins as streams do. */
  int CanReadFile(VTK_FILEPATH const char* name);

  ///@{
  /** Lines "Name: value" that go with every request, such as "Authorization: Bearer ...". */
  vtkSetStringMacro(Headers);
  vtkGetStringMacro(Headers);
  ///@}

  ///@{
  /** The coarsest level within this error, a fraction of the field's range (0.01). 0: the finest level. */
  vtkSetMacro(Error, double);
  vtkGetMacro(Error, double);
  void SetErrorPercent(double percent) { this->SetError(percent / 100); }
  double GetErrorPercent() { return 100 * this->Error; }
  ///@}

  ///@{
  /** The same in the field's units, instead of Error where it is not negative (-1). */
  vtkSetMacro(AbsError, double);
  vtkGetMacro(AbsError, double);
  ///@}

  ///@{
  /** The field that the error is about; none: every field that the stream controls. */
  vtkSetStringMacro(ErrorField);
  vtkGetStringMacro(ErrorField);
  ///@}

  ///@{
  /** 0: the certified maximum; 1: sampled, 2: rms, 3: predicted. */
  vtkSetClampMacro(Measure, int, 0, 3);
  vtkGetMacro(Measure, int);
  ///@}

  ///@{
  /** This level, whatever its error, where it is not negative (-1). */
  vtkSetMacro(Level, int);
  vtkGetMacro(Level, int);
  ///@}

  ///@{
  /** No level with more tetrahedra, or whose prefix has more bytes; 0: any (0). */
  vtkSetMacro(MaxTets, vtkTypeInt64);
  vtkGetMacro(MaxTets, vtkTypeInt64);
  vtkSetMacro(MaxBytes, vtkTypeInt64);
  vtkGetMacro(MaxBytes, vtkTypeInt64);
  ///@}

  ///@{
  /** A box, X0, X1, Y0, Y1, Z0, Z1, with an error of its own (off). */
  vtkSetMacro(Box, bool);
  vtkGetMacro(Box, bool);
  vtkBooleanMacro(Box, bool);
  vtkSetVector6Macro(BoxBounds, double);
  vtkGetVector6Macro(BoxBounds, double);
  vtkSetMacro(BoxError, double);
  vtkGetMacro(BoxError, double);
  void SetBoxErrorPercent(double percent) { this->SetBoxError(percent / 100); }
  double GetBoxErrorPercent() { return 100 * this->BoxError; }
  ///@}

  ///@{
  /** Gives a level of at most CoarseTets tetrahedra at once; what was asked for follows when GetNeedsUpdate was asked
   * (off; 100,000). */
  vtkSetMacro(CoarseFirst, bool);
  vtkGetMacro(CoarseFirst, bool);
  vtkBooleanMacro(CoarseFirst, bool);
  vtkSetMacro(CoarseTets, vtkTypeInt64);
  vtkGetMacro(CoarseTets, vtkTypeInt64);
  ///@}

  /** Is the output coarser than what was asked for? If so, the next update brings the rest: `if
   * (reader->GetNeedsUpdate()) window->Render();`. ParaView asks this of live sources by a timer. */
  bool GetNeedsUpdate();

  ///@{
  /** Which arrays are read. Values of cells lie behind all levels: of a URL they are off at first. */
  vtkDataArraySelection* GetPointDataArraySelection();
  vtkDataArraySelection* GetCellDataArraySelection();
  int GetNumberOfPointArrays();
  int GetNumberOfCellArrays();
  const char* GetPointArrayName(int index);
  const char* GetCellArrayName(int index);
  int GetPointArrayStatus(const char* name);
  int GetCellArrayStatus(const char* name);
  void SetPointArrayStatus(const char* name, int status);
  void SetCellArrayStatus(const char* name, int status);
  ///@}

protected:
  vtkTetlodReader();
  ~vtkTetlodReader() override;

  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

private:
  class Internals;

  bool Stopped(double progress);
  void OpenStream();
  void ReadOutputs(vtkInformationVector* outputs);
  int Fail(const char* what, unsigned long code);

  vtkTetlodReader(const vtkTetlodReader&) = delete;
  void operator=(const vtkTetlodReader&) = delete;

  char *FileName = nullptr, *Headers = nullptr, *ErrorField = nullptr;
  double Error = 0.01, AbsError = -1, BoxBounds[6] = { 0, 1, 0, 1, 0, 1 }, BoxError = 0;
  int Measure = 0, Level = -1;
  vtkTypeInt64 MaxTets = 0, MaxBytes = 0, CoarseTets = 100000;
  bool Box = false, CoarseFirst = false;
  bool Coarse = false, Due = false; // the output is coarse; the rest is due
  std::unique_ptr<Internals> Held;
};

#endif
