{{- define "skyway.pods" -}}
matchLabels:
  {{- include "skyway.selector" . | nindent 2 }}
{{- end -}}

{{- define "skyway.toDns" -}}
# Anywhere: a resolver on the node itself is no pod to a policy.
- ports:
    - { protocol: UDP, port: 53 }
    - { protocol: TCP, port: 53 }
{{- end -}}

{{/* Arguments: root, name, port. */}}
{{- define "skyway.toPod" -}}
- to:
    - podSelector:
        {{- include "skyway.pods" . | nindent 8 }}
  ports: [{ protocol: TCP, port: {{ .port }} }]
{{- end -}}

{{- define "skyway.toDatabase" -}}
- ports: [{ protocol: TCP, port: {{ int .Values.database.port }} }]
  {{- with .Values.networkPolicy.database }}
  to:
    {{- toYaml . | nindent 4 }}
  {{- end }}
{{- end -}}

{{/* The broker is in the registry's pod, or outside. Arguments: root, port, outsidePort. */}}
{{- define "skyway.toBroker" -}}
{{- if eq .root.Values.broker.mode "sidecar" -}}
{{ include "skyway.toPod" (dict "root" .root "name" "registry" "port" .port) }}
{{- else -}}
- ports: [{ protocol: TCP, port: {{ int .outsidePort }} }]
  {{- with .root.Values.networkPolicy.broker }}
  to:
    {{- toYaml . | nindent 4 }}
  {{- end }}
{{- end -}}
{{- end -}}

{{/* Arguments: root, port. */}}
{{- define "skyway.fromMonitoring" -}}
{{- if and .root.Values.monitoring.serviceMonitor.enabled .root.Values.networkPolicy.monitoring -}}
- from:
    {{- toYaml .root.Values.networkPolicy.monitoring | nindent 4 }}
  ports: [{ protocol: TCP, port: {{ .port }} }]
{{- end -}}
{{- end -}}
