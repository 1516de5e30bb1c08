{{/* What all pods have in common: no rights, no token, no variables named after other Services. */}}
{{- define "skyway.pod" -}}
automountServiceAccountToken: false
# A Service called skyway would otherwise set SKYWAY_PORT.
enableServiceLinks: false
securityContext:
  runAsNonRoot: true
  runAsUser: 10001
  runAsGroup: 10001
  fsGroup: 10001
  fsGroupChangePolicy: OnRootMismatch
  seccompProfile:
    type: RuntimeDefault
{{- with .Values.imagePullSecrets }}
imagePullSecrets:
  {{- range . }}
  - name: {{ . }}
  {{- end }}
{{- end }}
{{- end -}}

{{- define "skyway.container" -}}
securityContext:
  allowPrivilegeEscalation: false
  readOnlyRootFilesystem: true
  runAsNonRoot: true
  capabilities:
    drop: [ALL]
{{- end -}}

{{/* Where pods of a part run. Arguments: root, name of the part, service if it has another name. */}}
{{- define "skyway.placement" -}}
{{- $part := index .root.Values (.service | default .name) -}}
{{- with $part.priorityClassName }}
priorityClassName: {{ . }}
{{- end }}
{{- with $part.nodeSelector }}
nodeSelector:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with $part.tolerations }}
tolerations:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- with $part.affinity }}
affinity:
  {{- toYaml . | nindent 2 }}
{{- end }}
{{- end -}}

{{/* Replicas stand on different nodes where there is room. */}}
{{- define "skyway.spread" -}}
topologySpreadConstraints:
  - maxSkew: 1
    topologyKey: kubernetes.io/hostname
    whenUnsatisfiable: ScheduleAnyway
    labelSelector:
      matchLabels:
        {{- include "skyway.selector" . | nindent 8 }}
    matchLabelKeys: [pod-template-hash]
{{- end -}}

{{/* How a service reaches its database. Arguments: root, name; of a cell service, database, host. */}}
{{- define "skyway.databaseEnv" -}}
{{- $database := .root.Values.database -}}
{{- $port := printf ":%d" (int $database.port) -}}
{{- $hosts := splitList "," (.host | default $database.host) | join (printf "%s," $port) -}}
- name: SKYWAY_DATABASE_URL
  value: postgresql://skyway_{{ .service | default .name }}@{{ $hosts }}{{ $port }}/{{ .database | default (printf "skyway_%s" .name) }}?connections={{ int $database.connections }}{{ if $database.pooler }}&pooling=transaction{{ end }}
- name: PGPASSFILE
  value: /var/run/passfile/pgpass
- name: PGSSLMODE
  value: {{ $database.sslMode }}
{{- if $database.caSecret }}
- name: PGSSLROOTCERT
  value: /var/run/database-ca/ca.crt
{{- end }}
{{- end -}}

{{/* The environment of a service. Arguments: root, name, port, mqttUrl; of a cell as above. */}}
{{- define "skyway.env" -}}
{{- $fullname := include "skyway.fullname" .root -}}
{{ include "skyway.databaseEnv" . }}
- name: SKYWAY_HOST
  value: 0.0.0.0
- name: SKYWAY_PORT
  value: {{ .port | quote }}
- name: SKYWAY_SECRETS_DIR
  value: /var/lib/secrets
- name: SKYWAY_MQTT_URL
  value: {{ .mqttUrl }}
- name: SKYWAY_GATEWAY_URL
  value: http://{{ $fullname }}-gateway:8000
- name: SKYWAY_REGISTRY_URL
  value: http://{{ $fullname }}-registry:8001
- name: SKYWAY_COMPOSITION_URL
  value: http://{{ $fullname }}-composition:8002
{{- if eq (.service | default .name) "composition" }}
- name: SKYWAY_CELL_URL
  value: http://{{ $fullname }}-{{ .name }}:8002
{{- end }}
{{- $cells := list }}
{{- range $cell := .root.Values.cells }}
{{- range .networks }}
{{- $cells = append $cells (printf "%s=http://%s-cell-%s:8002" . $fullname $cell.name) }}
{{- end }}
{{- end }}
{{- with $cells }}
- name: SKYWAY_CELLS
  value: {{ join "," . | quote }}
{{- end }}
{{- range $name, $value := (index .root.Values (.service | default .name)).settings }}
- name: {{ $name }}
  value: {{ include "skyway.text" $value | quote }}
{{- end }}
{{- end -}}

{{/* A value as text. Helm reads whole numbers as floats, and would write 1000000 as 1e+06. */}}
{{- define "skyway.text" -}}
{{- if and (kindIs "float64" .) (eq (floor .) .) }}{{ int64 . }}{{ else }}{{ . }}{{ end -}}
{{- end -}}

{{/* Drivers refuse a passfile that a group can read, and a mounted Secret always is: so it is copied. */}}
{{- define "skyway.passfile" -}}
- name: passfile
  image: {{ include "skyway.image" .root }}
  imagePullPolicy: {{ .root.Values.image.pullPolicy }}
  command: [install, --mode=0600, /var/lib/secrets/pgpass, /var/run/passfile/pgpass]
  {{- include "skyway.container" . | nindent 2 }}
  resources:
    requests: { cpu: 10m, memory: 16Mi }
    limits: { memory: 64Mi }
  volumeMounts:
    - name: secrets
      mountPath: /var/lib/secrets
      readOnly: true
    - name: passfile
      mountPath: /var/run/passfile
{{- end -}}

{{- define "skyway.databaseMounts" -}}
- name: passfile
  mountPath: /var/run/passfile
  readOnly: true
{{- if .root.Values.database.caSecret }}
- name: database-ca
  mountPath: /var/run/database-ca
  readOnly: true
{{- end }}
{{- end -}}

{{- define "skyway.databaseVolumes" -}}
- name: passfile
  emptyDir: { medium: Memory, sizeLimit: 1Mi }
{{- with .root.Values.database.caSecret }}
- name: database-ca
  secret:
    secretName: {{ . }}
    defaultMode: 0440
    items: [{ key: ca.crt, path: ca.crt }]
{{- end }}
{{- end -}}

{{/* The mounts that every service has. */}}
{{- define "skyway.mounts" -}}
- name: secrets
  mountPath: /var/lib/secrets
  readOnly: true
- name: tmp
  mountPath: /tmp
{{ include "skyway.databaseMounts" . }}
{{- end -}}

{{- define "skyway.volumes" -}}
- name: secrets
  secret:
    secretName: {{ .secret | default (index .root.Values.secrets .name) }}
    defaultMode: 0440
- name: tmp
  emptyDir: { sizeLimit: 256Mi }
{{ include "skyway.databaseVolumes" . }}
{{- end -}}

{{/* A service waits for its database by itself: only /readyz says so, and nothing restarts it.
     Arguments: startupSeconds. */}}
{{- define "skyway.probes" -}}
startupProbe:
  httpGet: { path: /healthz, port: http }
  periodSeconds: 2
  timeoutSeconds: 5
  failureThreshold: {{ div .startupSeconds 2 }}
readinessProbe:
  httpGet: { path: /readyz, port: http }
  periodSeconds: 5
  timeoutSeconds: 5
  failureThreshold: 3
livenessProbe:
  httpGet: { path: /healthz, port: http }
  periodSeconds: 10
  timeoutSeconds: 5
  failureThreshold: 6
{{- end -}}
