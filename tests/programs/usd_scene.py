"""Run with OpenUSD: prints errors of all validators, and what UsdSkel reads at some time codes, as JSON."""

from __future__ import annotations

import json
import sys

from pxr import Usd, UsdMedia, UsdSkel, UsdValidation

stage = Usd.Stage.Open(sys.argv[1])
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
errors = UsdValidation.ValidationContext(validators).Validate(stage)
root = UsdSkel.Root(stage.GetPrimAtPath("/Character"))
cache = UsdSkel.Cache()
cache.Populate(root, Usd.PrimDefaultPredicate)
(binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
query = cache.GetSkelQuery(binding.GetSkeleton()).GetAnimQuery()
mesh = binding.GetSkinningTargets()[0]
values = {}
for code in map(float, sys.argv[2:]):
    names = list(query.GetBlendShapeOrder())
    values[code] = dict(zip(names, query.ComputeBlendShapeWeights(code), strict=True))
sounds = [prim for prim in stage.Traverse() if prim.IsA(UsdMedia.SpatialAudio)]
found = {
    "version": ".".join(map(str, Usd.GetVersion())),
    "validators": len(validators),
    "errors": [f"{each.GetName()}: {each.GetMessage()}" for each in errors],
    "rate": stage.GetTimeCodesPerSecond(),
    "end": stage.GetEndTimeCode(),
    "joints": list(mesh.GetJointOrder() or cache.GetSkelQuery(binding.GetSkeleton()).GetJointOrder()),
    "shapes": list(mesh.GetBlendShapeOrder()),
    "values": list(values.values()),
    "sound": UsdMedia.SpatialAudio(sounds[0]).GetFilePathAttr().Get().path if sounds else "",
}
print(json.dumps(found))
