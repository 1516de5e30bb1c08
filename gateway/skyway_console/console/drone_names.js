// The name of a drone: the one that its provider gave, or two words that are made from its id.

import {computed} from "@preact/signals";

import {picture} from "./live.js";
import {capital} from "./words.js";

const FIRST = ("amber azure bold brave bright brisk calm clear clever coral crisp daring deft eager early easy fair fleet "
  + "fond fresh gentle glad golden grand happy hardy hazel honest ivory jade jolly keen kind lively loyal lucky lunar mellow "
  + "merry mighty misty nimble noble olive opal pearl placid polar proud quick quiet rapid ready royal ruby silver smart snowy "
  + "solar steady sunny swift tidy true vivid warm").split(" ");
const SECOND = ("avocet bittern bunting condor coot crane curlew dipper dove dunlin eagle egret eider falcon finch gannet "
  + "goose grebe gull harrier hawk heron hoopoe ibis jay kestrel kite knot lapwing lark linnet loon magpie martin merlin "
  + "nightjar oriole osprey ouzel owl pelican petrel pigeon pipit plover puffin quail rail raven redstart robin rook ruff "
  + "shrike siskin skua snipe sparrow starling stork swallow swan swift teal tern thrush wagtail wren").split(" ");

// FNV-1a with a last mix, so that ids that differ in one letter get other words.
function numberOf(id) {
  let hash = 0x811c9dc5;
  for (const letter of id) hash = Math.imul(hash ^ letter.codePointAt(0), 0x01000193);
  hash ^= hash >>> 15;
  return Math.imul(hash, 0x2c1b3c6d) >>> 0;
}

const known = new Map();

function wordsOf(id) {
  if (!known.has(id)) {
    const number = numberOf(id);
    const second = SECOND[Math.floor(number / FIRST.length) % SECOND.length];
    known.set(id, `${capital(FIRST[number % FIRST.length])} ${capital(second)}`);
  }
  return known.get(id);
}

// Two drones of a large fleet may have the same words. Then the end of the id stands behind them.
const wordsThatStandTwice = computed(() => {
  const seen = new Set();
  const words = Object.keys(picture.drones.value).map(wordsOf);
  return new Set(words.filter((each) => seen.size === seen.add(each).size));
});

// `given` is the name that an answer of the API has, for drones outside of the live picture.
export function droneName(id, given = picture.drones.value[id]?.name) {
  if (given) return given;
  const words = wordsOf(id);
  return wordsThatStandTwice.value.has(words) ? `${words} ${id.slice(-2)}` : words;
}
