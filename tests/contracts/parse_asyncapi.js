// Parses an AsyncAPI document with the official parser; prints each error.
const { readFileSync } = require("node:fs");
const { createRequire } = require("node:module");

const [tools, document] = process.argv.slice(2);
const { Parser } = createRequire(`${tools}/`)("@asyncapi/parser");

new Parser().parse(readFileSync(document, "utf8")).then((result) => {
  const errors = result.diagnostics.filter((each) => each.severity === 0);
  for (const each of errors) console.log(`${each.path.join(".")}: ${each.message}`);
  process.exitCode = result.document && errors.length === 0 ? 0 : 1;
});
