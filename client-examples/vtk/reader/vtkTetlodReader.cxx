// SPDX-License-Identifier: BSD-3-Clause
#include "vtkTetlodReader.h"

#include <algorithm>
#include <cstring>
#include <fstream>

#include "tetlod_grid.h"
#include "tetlod_stream.h"

#include <vtkCallbackCommand.h>
#include <vtkDataArraySelection.h>
#include <vtkErrorCode.h>
#include <vtkInformation.h>
#include <vtkInformationVector.h>
#include <vtkNew.h>
#include <vtkObjectFactory.h>
#include <vtkStreamingDemandDrivenPipeline.h>
#include <vtkUnstructuredGrid.h>

vtkStandardNewMacro(vtkTetlodReader);

class vtkTetlodReader::Internals
{
public:
  std::unique_ptr<tetlod_stream> Stream;
  std::string Place, Headers; // that the stream was opened with
  vtkNew<vtkDataArraySelection> Points, Cells;
  vtkNew<vtkUnstructuredGrid> Last[2]; // the outputs, for when the work on new ones is stopped
};

namespace
{
std::string text_of(const char* text)
{
  return text ? text : "";
}

tetlod_stream::names enabled(vtkDataArraySelection* selection)
{
  tetlod_stream::names found;
  for (int i = 0; i < selection->GetNumberOfArrays(); i++)
    if (selection->GetArraySetting(i))
      found.emplace_back(selection->GetArrayName(i));
  return found;
}

// Arrays of a stream that was open before go; who has chosen keeps what was chosen.
void offer(vtkDataArraySelection* selection, const tetlod_stream::names& names, bool on)
{
  for (int i = selection->GetNumberOfArrays(); i-- > 0;)
    if (std::find(names.begin(), names.end(), selection->GetArrayName(i)) == names.end())
      selection->RemoveArrayByIndex(i);
  for (const std::string& name : names)
    selection->AddArray(name.c_str(), on);
}
}

vtkTetlodReader::vtkTetlodReader()
  : Held(new Internals)
{
  this->SetNumberOfInputPorts(0);
  this->SetNumberOfOutputPorts(2);
  vtkNew<vtkCallbackCommand> changed;
  changed->SetClientData(this);
  changed->SetCallback([](vtkObject*, unsigned long, void* self, void*) {
    static_cast<vtkTetlodReader*>(self)->Modified();
  });
  this->Held->Points->AddObserver(vtkCommand::ModifiedEvent, changed);
  this->Held->Cells->AddObserver(vtkCommand::ModifiedEvent, changed);
}

vtkTetlodReader::~vtkTetlodReader()
{
  this->SetFileName(nullptr);
  this->SetHeaders(nullptr);
  this->SetErrorField(nullptr);
}

int vtkTetlodReader::CanReadFile(const char* name)
{
  char start[8] = {};
  std::ifstream(name, std::ios::binary).read(start, sizeof start);
  return std::memcmp(start, "\x89TLD\r\n\x1a\n", sizeof start) == 0 ||
    std::memcmp(start, "\x89TLH\r\n\x1a\n", sizeof start) == 0; // a stream in a VTKHDF file
}

bool vtkTetlodReader::GetNeedsUpdate()
{
  if (this->Coarse && !this->Due)
  {
    this->Due = true;
    this->Modified();
  }
  return this->Coarse;
}

int vtkTetlodReader::Fail(const char* what, unsigned long code)
{
  this->SetErrorCode(code);
  vtkErrorMacro(<< text_of(this->FileName) << ": " << what);
  return 0;
}

bool vtkTetlodReader::Stopped(double progress)
{
  this->UpdateProgress(std::max(progress, this->Progress));
  return this->GetAbortExecute() != 0;
}

void vtkTetlodReader::OpenStream()
{
  const std::string place = text_of(this->FileName), headers = text_of(this->Headers);
  Internals& held = *this->Held;
  if (held.Stream && held.Place == place && held.Headers == headers)
    return;
  held.Stream.reset();
  held.Last[0]->Initialize();
  held.Last[1]->Initialize();
  this->Coarse = this->Due = false;
  held.Stream.reset(new tetlod_stream(place, headers, [this](double part) { return this->Stopped(part); }));
  held.Place = place;
  held.Headers = headers;
  offer(held.Points, held.Stream->field_names(), true);
  offer(held.Cells, held.Stream->cell_names(), !tetlod_bytes::is_url(place));
}

int vtkTetlodReader::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  using pipeline = vtkStreamingDemandDrivenPipeline;
  this->SetErrorCode(vtkErrorCode::NoError);
  if (text_of(this->FileName).empty())
    return this->Fail("FileName is not set", vtkErrorCode::NoFileNameError);
  try
  {
    this->OpenStream();
  }
  catch (const std::exception& problem)
  {
    return this->Fail(problem.what(), vtkErrorCode::CannotOpenFileError);
  }
  const std::vector<double>& times = this->Held->Stream->times();
  for (int port = 0; port < this->GetNumberOfOutputPorts(); port++)
  {
    vtkInformation* out = outputs->GetInformationObject(port);
    out->Remove(pipeline::TIME_STEPS());
    out->Remove(pipeline::TIME_RANGE());
    if (times.empty())
      continue;
    const double range[2] = { times.front(), times.back() };
    out->Set(pipeline::TIME_STEPS(), times.data(), static_cast<int>(times.size()));
    out->Set(pipeline::TIME_RANGE(), range, 2);
  }
  return 1;
}

int vtkTetlodReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    this->ReadOutputs(outputs);
  }
  catch (const tetlod_cancelled&)
  {
    this->Coarse = this->Due = false; // whoever stopped it does not want the rest with the next picture
    for (int port = 0; port < this->GetNumberOfOutputPorts(); port++)
      vtkUnstructuredGrid::GetData(outputs, port)->ShallowCopy(this->Held->Last[port]);
  }
  catch (const std::exception& problem)
  {
    this->Coarse = this->Due = false;
    return this->Fail(problem.what(), vtkErrorCode::FileFormatError);
  }
  return 1;
}

void vtkTetlodReader::ReadOutputs(vtkInformationVector* outputs)
{
  using pipeline = vtkStreamingDemandDrivenPipeline;
  Internals& held = *this->Held;
  tetlod_stream& stream = *held.Stream;
  vtkInformation* out = outputs->GetInformationObject(0);
  const bool series = !stream.times().empty();
  const double time = !series ? 0
    : out->Has(pipeline::UPDATE_TIME_STEP()) ? out->Get(pipeline::UPDATE_TIME_STEP())
                                             : stream.times().front();
  const tetlod_stream::names fields = enabled(held.Points), cells = enabled(held.Cells);
  tetlod_choice choice = { this->Error, this->AbsError, static_cast<tetlod_measure>(this->Measure),
    text_of(this->ErrorField), this->Level, static_cast<uint64_t>(std::max<vtkTypeInt64>(this->MaxTets, 0)),
    static_cast<uint64_t>(std::max<vtkTypeInt64>(this->MaxBytes, 0)) };
  std::string warning;
  const auto wanted = [&] {
    return series ? stream.band_for(time, choice) : stream.level_for(choice, warning);
  };
  const auto give = [&](uint32_t number, const double* box, int port) {
    tetlod_fill_grid(series ? stream.step(time, number, fields, cells) : stream.level(number, fields, cells), box,
      vtkUnstructuredGrid::GetData(outputs, port));
  };

  const uint32_t asked = wanted();
  uint32_t first = asked;
  if (this->CoarseFirst && !this->Due)
  {
    const uint64_t tets = static_cast<uint64_t>(std::max<vtkTypeInt64>(this->CoarseTets, 0));
    first = series ? stream.coarse_band(time, tets)
                   : std::max(tetlod_level_for_tets(&stream.info(), tets), stream.current_level());
    first = std::min(first, asked);
  }
  if (!warning.empty())
    vtkWarningMacro(<< held.Place << ": " << warning);
  this->Coarse = first < asked;
  this->Due = false;
  uint32_t outside = asked, fine = asked;
  bool one_mesh = false; // of a stream in pages: output 0 is finer in the box
  if (this->Box && !this->Coarse)
  {
    choice = { this->BoxError, -1, choice.measure, choice.field, -1, 0, 0 };
    fine = std::max(wanted(), asked);
    const uint32_t in_pages = this->BoxError > 0 ? fine : std::min(fine, stream.finest_region());
    one_mesh = !series && stream.has_region(outside, in_pages);
    fine = one_mesh ? in_pages : fine;
  }
  if (one_mesh)
    tetlod_fill_grid(stream.region(outside, fine, this->BoxBounds, fields, cells), nullptr,
      vtkUnstructuredGrid::GetData(outputs, 0));
  else
    give(first, nullptr, 0);
  if (this->Box && !this->Coarse && !one_mesh)
    give(fine, this->BoxBounds, 1);
  for (int port = 0; port < this->GetNumberOfOutputPorts(); port++)
    held.Last[port]->ShallowCopy(vtkUnstructuredGrid::GetData(outputs, port));
}

vtkDataArraySelection* vtkTetlodReader::GetPointDataArraySelection()
{
  return this->Held->Points;
}

vtkDataArraySelection* vtkTetlodReader::GetCellDataArraySelection()
{
  return this->Held->Cells;
}

int vtkTetlodReader::GetNumberOfPointArrays()
{
  return this->Held->Points->GetNumberOfArrays();
}

int vtkTetlodReader::GetNumberOfCellArrays()
{
  return this->Held->Cells->GetNumberOfArrays();
}

const char* vtkTetlodReader::GetPointArrayName(int index)
{
  return this->Held->Points->GetArrayName(index);
}

const char* vtkTetlodReader::GetCellArrayName(int index)
{
  return this->Held->Cells->GetArrayName(index);
}

int vtkTetlodReader::GetPointArrayStatus(const char* name)
{
  return this->Held->Points->ArrayIsEnabled(name);
}

int vtkTetlodReader::GetCellArrayStatus(const char* name)
{
  return this->Held->Cells->ArrayIsEnabled(name);
}

void vtkTetlodReader::SetPointArrayStatus(const char* name, int status)
{
  this->Held->Points->SetArraySetting(name, status);
}

void vtkTetlodReader::SetCellArrayStatus(const char* name, int status)
{
  this->Held->Cells->SetArraySetting(name, status);
}

void vtkTetlodReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FileName: " << text_of(this->FileName) << "\n"
     << indent << "Error: " << this->Error << ", AbsError: " << this->AbsError
     << ", ErrorField: " << text_of(this->ErrorField) << ", Measure: " << this->Measure << "\n"
     << indent << "Level: " << this->Level << ", MaxTets: " << this->MaxTets << ", MaxBytes: " << this->MaxBytes
     << "\n"
     << indent << "Box: " << this->Box << ", BoxError: " << this->BoxError << "\n"
     << indent << "CoarseFirst: " << this->CoarseFirst << ", CoarseTets: " << this->CoarseTets << "\n";
}
