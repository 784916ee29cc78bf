// node vmd_keys.cjs FOLDER_OF_MMD_PARSER FILE.vmd: prints the keys of morphs and bones as three.js reads them, as JSON
const { Parser } = require(process.argv[2]);
const content = require("fs").readFileSync(process.argv[3]);
const bytes = content.buffer.slice(content.byteOffset, content.byteOffset + content.length);
const vmd = new Parser().parseVmd(bytes, true);
const { morphs, motions, metadata } = vmd;
console.log(JSON.stringify({ metadata, morphs, motions }));
