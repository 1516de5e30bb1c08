{{/* The Service of a part. Arguments: root, name, port. */}}
{{- define "skyway.service" -}}
apiVersion: v1
kind: Service
metadata:
  name: {{ include "skyway.fullname" .root }}-{{ .name }}
  labels:
    {{- include "skyway.labels" . | nindent 4 }}
spec:
  type: ClusterIP
  selector:
    {{- include "skyway.selector" . | nindent 4 }}
  ports:
    - name: http
      port: {{ .port }}
      targetPort: http
{{- end -}}
