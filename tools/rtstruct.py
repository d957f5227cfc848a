#!/usr/bin/env python3
"""Makes samples/phantom.dcm, an RT Structure Set of our own, by another library, and checks that
what nurbray writes is a structure set for it: tools/rtstruct.py [NURBRAY]

Needs pydicom (pip install pydicom)."""
import math
import pathlib
import subprocess
import sys
import tempfile

import pydicom
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

CLASS = "1.2.840.10008.5.1.4.1.1.481.3"
HERE = pathlib.Path(__file__).resolve().parent.parent


def ring(count, radius, x, y, z):
    """Points of a slightly squeezed circle."""
    angles = [2 * math.pi * k / count for k in range(count)]
    return [(x + radius * math.cos(a), y + 0.8 * radius * math.sin(a), z) for a in angles]


def contour(points, kind="CLOSED_PLANAR"):
    item = Dataset()
    item.ContourGeometricType = kind
    item.NumberOfContourPoints = len(points)
    item.ContourData = [f"{x:.4f}" for point in points for x in point]
    return item


def phantom():
    """Two bodies and a point; the contours of one stand in no order."""
    ball = [ring(12 + k, 30 * math.sin(math.pi * (k + 1) / 8), 5, -20, 9.0 * k) for k in range(7)]
    tube = [ring(16, 6, 50 + 2 * k, 10, 4.0 * k) for k in range(6)]
    tube = [tube[k] for k in (3, 0, 5, 1, 4, 2)]
    uid = lambda name: generate_uid(entropy_srcs=["nurbray phantom", name])
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CLASS
    meta.MediaStorageSOPInstanceUID = uid("instance")
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    file = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
    file.SpecificCharacterSet = "ISO_IR 100"
    file.SOPClassUID, file.SOPInstanceUID = CLASS, uid("instance")
    file.Modality, file.PatientName, file.PatientID = "RTSTRUCT", "Phantom", "0"
    file.StudyInstanceUID, file.SeriesInstanceUID = uid("study"), uid("series")
    file.StructureSetLabel = "phantom"
    names = ["K\u00f6rper", "Tube", "Isocentre"]
    colors = [(200, 180, 140), (60, 120, 200), (255, 0, 0)]
    contours = [[contour(p) for p in ball], [contour(p) for p in tube],
                [contour([(0.0, 0.0, 0.0)], "POINT")]]
    file.StructureSetROISequence, file.ROIContourSequence = Sequence(), Sequence()
    for number, (name, color, items) in enumerate(zip(names, colors, contours), 1):
        roi = Dataset()
        roi.ROINumber, roi.ROIName = number, name
        roi.ReferencedFrameOfReferenceUID = uid("frame")
        roi.ROIGenerationAlgorithm = "MANUAL"
        file.StructureSetROISequence.append(roi)
        item = Dataset()
        item.ROIDisplayColor, item.ReferencedROINumber = list(color), number
        item.ContourSequence = Sequence(items)
        file.ROIContourSequence.append(item)
    return file


def check(program):
    """What nurbray writes, as pydicom reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "head.dcm"
        line = [program, "model", "--synthetic", "skull,pathology", "-o", str(path)]
        subprocess.run(line, check=True)
        file = pydicom.dcmread(path)
        assert file.SOPClassUID == CLASS and file.Modality == "RTSTRUCT"
        names = [roi.ROIName for roi in file.StructureSetROISequence]
        assert names == ["skull", "pathology"], names
        for item in file.ROIContourSequence:
            for one in item.ContourSequence:
                assert one.ContourGeometricType == "CLOSED_PLANAR"
                assert len(one.ContourData) == 3 * one.NumberOfContourPoints
        counts = [len(item.ContourSequence) for item in file.ROIContourSequence]
        print(f"pydicom {pydicom.__version__} reads {names} with {counts} contours")


if __name__ == "__main__":
    phantom().save_as(HERE / "samples" / "phantom.dcm", enforce_file_format=True)
    print("samples/phantom.dcm is written")
    if len(sys.argv) > 1:
        check(sys.argv[1])
