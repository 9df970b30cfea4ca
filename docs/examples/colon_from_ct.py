"""A colon from CT: a label map becomes a colon with a centreline, segments and measures.

The label map is made here, of a grown colon, in place of one that a radiologist has drawn; NIfTI, NRRD and MetaImage
are read alike. Needs `pip install haustra[ct]`.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import SimpleITK as sitk
from scipy.ndimage import distance_transform_edt

import haustra

VOXEL = 0.003  # m

grown = haustra.grow_colon(seed=0)
line = grown.centreline
low = line.points.min(axis=0) - 0.05
shape = np.ceil((line.points.max(axis=0) + 0.05 - low) / VOXEL).astype(int)
outside, station = np.ones(shape, bool), np.zeros(shape, int)
voxels = tuple(((line.points - low) / VOXEL).astype(int).T)
outside[voxels], station[voxels] = False, np.arange(len(line.points))
away, nearest = distance_transform_edt(outside, sampling=VOXEL, return_indices=True)
inside = away < grown.radius.mean(axis=1)[station[tuple(nearest)]]
image = sitk.GetImageFromArray(inside.astype(np.uint8).transpose(2, 1, 0))
image.SetSpacing([1e3 * VOXEL] * 3)
image.SetOrigin((1e3 * low).tolist())
sitk.WriteImage(image, "colon.nii.gz")

colon = haustra.import_label_map(Path("colon.nii.gz"), anus=tuple(1e3 * line.points[0]))
haustra.save_colon(colon, Path("colon"))
print(f"{colon.centreline.length:.2f} m long, grown {line.length:.2f} m")

plt.figure(figsize=(6, 3), layout="constrained")
for name, one in (("label map", colon), ("grown", grown)):
    plt.plot(one.centreline.arc, 2e3 * one.radius.mean(axis=1), label=name)
plt.xlabel("distance from the anus [m]")
plt.ylabel("diameter of the lumen [mm]")
plt.legend()
plt.savefig("colon_from_ct.webp")
