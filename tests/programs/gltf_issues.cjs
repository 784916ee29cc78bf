// node gltf_issues.cjs FOLDER_OF_GLTF_VALIDATOR FILE.glb: prints the validator's version and what it found, as JSON
const validator = require(process.argv[2]);
const bytes = new Uint8Array(require("fs").readFileSync(process.argv[3]));
validator.validateBytes(bytes).then((report) => {
  console.log(JSON.stringify({ version: validator.version(), ...report.issues }));
});
