// A shop's day with `@skyway/client`: quote, accept, change, PIN, webhook, list, statement.
// The arguments are the gateway's URL, a customer's key, the pickup and the destination. The system
// has a network and drones that can fly it.

import assert from 'node:assert/strict'
import { once } from 'node:events'
import { createServer } from 'node:http'
import type { AddressInfo } from 'node:net'
import { text } from 'node:stream/consumers'

import { answer, createSkyway, each, problems, readNotification } from '@skyway/client'

const [url = '', key = '', start = '', end = ''] = process.argv.slice(2)
const skyway = createSkyway({ url, key })

// The shop's server reads the notifications that it can verify.
let secret = ''
const received: string[] = []
const server = createServer(async (request, response) => {
  const headers = request.headers as Record<string, string>
  const { type } = readNotification(secret, headers, await text(request))
  received.push(type)
  response.writeHead(204).end()
  if (type === 'delivery.completed') server.emit('completed')
})
const isCompleted = once(server, 'completed')
await once(server.listen(0, '127.0.0.1'), 'listening')
const { port } = server.address() as AddressInfo
const hook = { url: `http://127.0.0.1:${port}/skyway` }
const issued = await answer(skyway.api.POST('/v1/webhooks', { body: hook }))
secret = issued.secret

// It asks for offers, and accepts the best one, once.
const dropoff_verification = { method: 'PIN' as const, wait_s: 900 }
const destination = { station_id: end }
const item = { package_id: 'p1', mass_kg: 0.8, destination, dropoff_verification }
const body = { pickup: { station_id: start }, packages: [item] }
const quote = await answer(skyway.api.POST('/v1/quotes', { body }))
const offer_id = quote.offers[0]?.offer_id ?? ''
const choice = { body: { quote_id: quote.quote_id, offer_id } }
const { delivery_id } = await answer(skyway.api.POST('/v1/deliveries', choice))
await assert.rejects(skyway.api.POST('/v1/deliveries', choice), problems.QuoteTaken)
const instructions = 'leave it at the door'
const path = { delivery_id }
const change = { params: { path }, body: { instructions } }
const changed = await answer(skyway.api.PATCH('/v1/deliveries/{delivery_id}', change))
assert.equal(changed.instructions, instructions)

// The recipient types the PIN as the tracking page does: it needs no key.
const call = { params: { path } }
async function typePin() {
  const { packages } = await answer(skyway.api.GET('/v1/deliveries/{delivery_id}', call))
  const link = skyway.api.GET('/v1/deliveries/{delivery_id}/tracking-link', call)
  const { tracking_url } = await answer(link)
  const body = JSON.stringify({ package_id: 'p1', pin: packages[0]?.dropoff_proof?.pin })
  const headers = { 'content-type': 'application/json' }
  const typed = await fetch(`${tracking_url}/proof`, { method: 'POST', headers, body })
  assert.equal(typed.status, 204)
}

// It follows the delivery, finds it in the list, and has to pay for it.
const events: string[] = []
let month = ''
for await (const event of skyway.events(delivery_id)) {
  events.push(event.type)
  month = event.occurred_at.slice(0, 7)
  if (event.type === 'delivery.proof_awaited') await typePin()
}
const done = await answer(skyway.api.GET('/v1/deliveries/{delivery_id}', call))
assert.equal(done.packages[0]?.dropoff_proof?.given_by, 'RECIPIENT')
await isCompleted
assert.deepEqual(received, events)
assert.throws(() => readNotification(secret, { 'webhook-signature': 'v1,AA==' }, '{}'))
const list = (cursor: string | null) =>
  answer(skyway.api.GET('/v1/deliveries', { params: { query: { cursor, limit: 1 } } }))
const states = new Map<string, string>()
for await (const delivery of each(list)) states.set(delivery.delivery_id, delivery.state)
const statements = (cursor: string | null) =>
  answer(skyway.api.GET('/v1/statements', { params: { query: { cursor, month } } }))
let spent = 0
for await (const { amount } of each(statements)) spent += amount
assert(spent > 0)
// The next owner of this port must not be notified.
const ours = { params: { path: { webhook_id: issued.webhook_id } } }
await skyway.api.DELETE('/v1/webhooks/{webhook_id}', ours)
console.log(states.get(delivery_id))
server.close()
server.closeAllConnections()
