// Writes src/problems.ts: what follows from the OpenAPI document besides its types.

import { readFileSync, writeFileSync } from 'node:fs'

const document = JSON.parse(readFileSync(new URL('../../openapi/gateway.json', import.meta.url), 'utf8'))

/** All examples of problem documents. */
function* problems(part) {
  if (part === null || typeof part !== 'object') return
  if (String(part.type ?? '').startsWith('urn:skyway:problem:') && 'status' in part) yield part
  for (const each of Object.values(part)) yield* problems(each)
}

/** The name of a class: offer-lost and OFFER_LOST are OfferLost. */
const className = (words) =>
  words.map((word) => word[0].toUpperCase() + word.slice(1).toLowerCase()).join('')

const codes = new Map()
for (const { type, code } of problems(document)) {
  if (!codes.has(type)) codes.set(type, new Set())
  if (code) codes.get(type).add(code)
}

const classes = []
const byType = []
const byCode = []
for (const type of [...codes.keys()].sort()) {
  const parent = className(type.split(':').at(-1).split('-'))
  classes.push(`/** \`${type}\`. */\nexport class ${parent} extends SkywayError {}`)
  byType.push(`  '${type}': ${parent},`)
  for (const code of [...codes.get(type)].sort()) {
    const name = className(code.split('_'))
    classes.push(`/** \`${type}\` with the code ${code}. */\nexport class ${name} extends ${parent} {}`)
    byCode.push(`  ${code}: ${name},`)
  }
}

const takesKey = ({ parameters = [] }) => parameters.some(({ name }) => name === 'idempotency-key')
const keyed = Object.entries(document.paths)
  .filter(([, { post }]) => post && takesKey(post))
  .map(([path]) => `  /^${path.replaceAll('/', '\\/').replaceAll(/{\w+}/g, '[^/]+')}$/,`)

const module = `// Made by generate.mjs from the OpenAPI document.

import { SkywayError, type SkywayErrorClass } from './errors.js'

${classes.join('\n\n')}

export const BY_TYPE: Readonly<Record<string, SkywayErrorClass>> = {
${byType.join('\n')}
}

export const BY_CODE: Readonly<Record<string, SkywayErrorClass>> = {
${byCode.join('\n')}
}

/** The paths whose POST takes an idempotency key. */
export const KEYED_PATHS: readonly RegExp[] = [
${keyed.join('\n')}
]
`
writeFileSync(new URL('src/problems.ts', import.meta.url), module)
