/** A problem document (RFC 9457) as Skyway sends it; other members may be added. */
export interface Problem {
  type?: string
  title?: string
  detail?: string | null
  code?: string | null
  errors?: { field: string; detail: string }[]
  trace_id?: string | null
  [member: string]: unknown
}

/** A call that the server refused. `problems` has a subclass for each type and each code. */
export class SkywayError extends Error {
  readonly status: number
  readonly type: string
  readonly code: string | null
  readonly problem: Problem
  /** After how many seconds the server asks to try again; null if it does not say. */
  readonly retryAfterS: number | null

  constructor(status: number, problem: Problem, retryAfterS: number | null) {
    super(problem.detail ?? problem.title ?? `status ${status}`)
    this.name = new.target.name
    this.status = status
    this.type = problem.type ?? 'about:blank'
    this.code = problem.code ?? null
    this.problem = problem
    this.retryAfterS = retryAfterS
  }
}

export type SkywayErrorClass = typeof SkywayError
